# SPDX-License-Identifier: GPL-3.0-or-later
"""How long adapting the reference head to the sample scan takes, beside a peer's registration in the same run.

    python benchmarks/adapt.py [--runs 3] [--seed 8]

The peer is ``trimesh.registration.nricp_amberg`` (Amberg, Romdhani and Vetter 2007) with the same template, scan and
landmarks. It yields a skin only, so ratios are to our skin alone; the whole head adds skull, muscles, eyes and teeth.
Errors are in the face, where a scanner sees it: ``scan`` is the distance of the template's vertices to the scan,
``truth`` to the point of the noise-free subject that each of them should have found. Times compare within a run only.
Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import NORMALS
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.anatomy.storage import load_head
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.orientation import detect
from headshop.sim.scan.sample import SEED, make_sample


def timed(work):
    """The result of a work and the seconds between its progress steps, by label."""
    steps, last = {}, [None, time.perf_counter()]

    def note(step):
        now = time.perf_counter()
        if last[0]:
            steps[last[0]] = steps.get(last[0], 0) + now - last[1]
        last[:] = [step.label, now]

    result = finish(work, note)
    steps[last[0]] = steps.get(last[0], 0) + time.perf_counter() - last[1]
    return result, steps


def similarity(source, target):
    """Scale, rotation and shift that lay ``source`` (n, 3) on ``target`` (Umeyama 1991)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, s, vt = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    scale = s.sum() / (a**2).sum()
    return lambda p: scale * (p - source.mean(axis=0)) @ turn.T + target.mean(axis=0)


def landmark_triangles(reference, triangles):
    """The landmarks as indices of ``triangles`` and barycentric weights, and which of them lie in one."""
    row = {tuple(sorted(t)): k for k, t in enumerate(triangles.tolist())}
    found, weights, kept = [], [], []
    for name, part, corners, weight in zip(*vars(reference.landmarks).values(), strict=True):
        key = tuple(sorted(corners.tolist()))
        if part == "skin" and key in row:
            order = [corners.tolist().index(v) for v in triangles[row[key]]]
            found.append(row[key])
            weights.append(weight[order])
            kept.append(name)
    return np.array(found), np.array(weights), kept


def errors(vertices, sample, scan, face):
    """Median, mean and 95 % of the distances of face vertices to the scan (where it has data) and to the truth, mm."""
    to_scan = scan.closest(vertices[face])
    near = to_scan.distance[~to_scan.border & (to_scan.distance < 10)]
    to_truth = np.linalg.norm(vertices[face] - sample.truth.skin.vertices[face], axis=1)
    return {
        "scan_mean_mm": float(near.mean()),
        "scan_p95_mm": float(np.percentile(near, 95)),
        "truth_mean_mm": float(to_truth.mean()),
        "truth_p95_mm": float(np.percentile(to_truth, 95)),
    }


def peer(reference, sample, mesh, threshold):
    """Vertices of the template (n, 3) registered by trimesh, and the seconds that took."""
    import trimesh

    outside = reference.groups["inner"] <= 0.5
    triangles = reference.skin.triangles
    triangles = triangles[outside[triangles].all(axis=1)]
    place, weights, names = landmark_triangles(reference, triangles)
    on = reference.landmark_positions()
    goal = np.array([sample.landmarks[n] for n in names])
    start = similarity(np.array([on[n] for n in names]), goal)(reference.skin.vertices)
    used = np.unique(triangles)
    local = np.full(len(start), -1)
    local[used] = np.arange(len(used))
    source = trimesh.Trimesh(start[used], local[triangles], process=False)
    target = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    begin = time.perf_counter()
    moved = trimesh.registration.nricp_amberg(source, target, (place, weights), goal, distance_threshold=threshold)
    seconds = time.perf_counter() - begin
    out = start.copy()
    out[used] = moved
    return out, seconds


def skin_only(reference, mesh, landmarks):
    """Seconds from the clean scan to the fitted skin."""
    begin = time.perf_counter()
    finish(fit_skin(reference, Surface(mesh.vertices, mesh.triangles, smooth=NORMALS), landmarks))
    return time.perf_counter() - begin


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=3, help="the fastest of so many counts")
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    reference = load_head()
    begin = time.perf_counter()
    sample = finish(make_sample(options.seed))
    stages = {"make the sample": time.perf_counter() - begin}
    begin = time.perf_counter()
    mesh, counts = clean_scan(sample.scan)
    stages["clean the scan"] = time.perf_counter() - begin
    begin = time.perf_counter()
    detect(mesh)
    stages["find unit and axes"] = time.perf_counter() - begin
    runs = [timed(build_head(reference, mesh, sample.landmarks)) for _ in range(options.runs)]
    built, steps = min(runs, key=lambda run: sum(run[1].values()))
    whole = sum(steps.values())
    scan = Surface(mesh.vertices, mesh.triangles)
    face = (reference.groups["face"] > 0.5) & (reference.groups["inner"] <= 0.5)
    face &= sample.truth.skin.vertices[:, 2] > sample.landmarks["gn"][2] - 5
    ours = errors(built.head.skin.vertices, sample, scan, face)
    skin = min(skin_only(reference, mesh, sample.landmarks) for _ in range(options.runs))
    rows = [("Head Shop, skin alone", skin, ours), ("Head Shop, whole head", whole, ours)]
    try:
        import rtree  # noqa: F401 (trimesh looks for the closest triangle with it)
        import trimesh

        for threshold in (0.1, 0.02):
            tries = [peer(reference, sample, mesh, threshold) for _ in range(min(options.runs, 2))]
            vertices, seconds = min(tries, key=lambda t: t[1])
            name = f"trimesh {trimesh.__version__} nricp_amberg, threshold {threshold:g}"
            rows.append((name, seconds, errors(vertices, sample, scan, face)))
    except ImportError as error:
        print(f"no peer: {error} (pip install trimesh rtree)")
    print(
        f"{counts['triangles']} triangles, {len(sample.landmarks)} landmarks, {len(reference.skin.vertices)} vertices\n"
    )
    for label, seconds in {**stages, **steps}.items():
        print(f"  {label:<40}{seconds:8.2f} s")
    print(f"\n{'':<46}{'seconds':>8}{'ratio':>8}   scan mean / 95 %   truth mean / 95 %  (mm)")
    for name, seconds, e in rows:
        print(
            f"{name:<46}{seconds:8.2f}{seconds / skin:7.1f}x{e['scan_mean_mm']:10.3f} /{e['scan_p95_mm']:6.2f}"
            f"{e['truth_mean_mm']:11.2f} /{e['truth_p95_mm']:6.2f}"
        )
    result = {
        "triangles": counts["triangles"],
        "seconds": {**stages, **steps},
        "rows": [{"name": n, "seconds": s, "ratio": s / skin, **e} for n, s, e in rows],
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
