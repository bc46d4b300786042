# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast and how well the skin is adapted to scans, beside peers in the same run, and how that grows with the scan.

    python benchmarks/adapt.py [--people 3] [--folder DIR] [--no-scale]

The peers are ``trimesh.registration.nricp_amberg`` and ``nricp_sumner`` (`adapt_peers`), each at the best of several
settings: on the first person all are tried, and the one with the least error is taken for the others. Errors are those
of the template's seen vertices, in the face on partial scans: to the scan where it has data, and to the point of the
subject that each vertex should have found, where that is known. Times are from scan and landmarks in memory to the
fitted skin, elapsed and of CPU; they compare within a run only. Prints tables and, on the last line, the same as JSON.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from adapt_peers import SETTINGS, Template
from adapt_subjects import folder_subjects, own_subjects

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import scan_surface
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.anatomy.storage import load_head
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.orientation import detect
from headshop.sim.scan.sample import SEED

COLUMNS = ("seconds", "cpu", "mean_mm", "p95_mm", "max_mm", "truth_mm", "flipped")
COUNTS = (20_000, 100_000, 500_000, 2_000_000)
#: The most our part of the peers' seconds (of each) and errors (of the better one) should be.
GOALS = {"nricp_amberg": 1 / 5, "nricp_sumner": 1 / 3, "mean_mm": 1 / 4, "max_mm": 1.0, "truth_mm": 0.7}


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


def adapted(reference, subject):
    """Our skin as drawn (n, 3) mm for a subject, and the seconds from scan and landmarks to it, elapsed and of CPU."""
    begin, used = time.perf_counter(), time.process_time()
    fit = finish(fit_skin(reference, scan_surface(reference, subject.scan, subject.landmarks), subject.landmarks))
    seconds = {"seconds": time.perf_counter() - begin, "cpu": time.process_time() - used}
    return drawn(reference.skin.faces, fit.cage), seconds


def errors(vertices, subject, scan: Surface, template: Template, face):
    """A row of `COLUMNS` without the seconds, for fitted vertices (n, 3) mm."""
    seen = np.zeros(len(vertices), dtype=bool)
    seen[template.used] = True
    if subject.kind == "partial":
        seen &= face
    found = scan.closest(vertices[seen], 10.0)
    near = found.distance[found.found & ~found.border]
    row = {"mean_mm": near.mean(), "p95_mm": np.percentile(near, 95), "max_mm": near.max(), "truth_mm": np.nan}
    triangles = template.triangles[seen[template.triangles].all(axis=1)]
    if subject.truth is None:  # beside its neighbours a flipped triangle looks the other way
        row["flipped"] = turned_from_neighbours(vertices, triangles)
    else:
        row["truth_mm"] = np.linalg.norm(vertices[seen] - subject.truth[seen], axis=1).mean()
        one, other = (normals(v, triangles) for v in (vertices, subject.truth))
        row["flipped"] = (np.einsum("ij,ij->i", one, other) < 0).sum()
    return {name: float(value) for name, value in row.items()}


def normals(vertices, triangles):
    """(t, 3) of triangles, as long as they are large."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def turned_from_neighbours(vertices, triangles):
    """How many triangles face away from the mean of those around their corners."""
    normal = normals(vertices, triangles)
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, triangles[:, k], normal)
    return (np.einsum("ij,ij->i", normal, total[triangles].sum(axis=1)) < 0).sum()


def compared(reference, subjects, template, face, peers):
    """Rows of ours and of each peer at its best setting, all kinds: {kind: {name: [row, ...]}}, settings and trials."""
    rows, chosen, trials = {}, {}, []
    for subject in subjects:
        scan = Surface(subject.scan.vertices, subject.scan.triangles)
        mine = rows.setdefault(subject.kind, {})
        vertices, seconds = adapted(reference, subject)
        ours = seconds | errors(vertices, subject, scan, template, face)
        mine.setdefault("Head Shop", []).append(ours)
        for peer in peers:
            names = [chosen[subject.kind, peer]] if (subject.kind, peer) in chosen else list(SETTINGS[peer])
            tried = []
            for name in names:
                vertices, seconds = template.registered(peer, SETTINGS[peer][name], subject)
                row = seconds | errors(vertices, subject, scan, template, face)
                tried.append((row["mean_mm"] if subject.kind == "whole" else row["truth_mm"], name, row))
                if len(names) > 1:
                    trials.append({"kind": subject.kind, "peer": peer, "setting": name} | row)
            known = [t for t in tried if np.isfinite(t[0])] or [(t[2]["mean_mm"], *t[1:]) for t in tried]
            _, chosen[subject.kind, peer], best = min(known, key=lambda t: t[0])
            mine.setdefault(peer, []).append(best)
        # Once more after the peers: the machine may have been busy with something else.
        again = adapted(reference, subject)[1]
        ours |= {name: min(ours[name], value) for name, value in again.items()}
    return rows, chosen, trials


def medians(rows):
    """The median of each column over subjects."""
    return {column: float(np.median([row[column] for row in rows])) for column in COLUMNS}


def printed(title, table):
    """A table {name: row of `COLUMNS`} with the ratios to the first row's seconds."""
    heads = (
        f"{'seconds':>9}{'ratio':>8}{'CPU':>8}{'ratio':>8}{'mean':>9}{'95 %':>8}{'max':>8}{'truth':>8}{'flipped':>9}"
    )
    print(f"\n{title:<44}{heads}")
    first = next(iter(table.values()))
    for name, row in table.items():
        print(
            f"{name:<44}{row['seconds']:9.2f}{row['seconds'] / first['seconds']:7.1f}x{row['cpu']:8.2f}"
            f"{row['cpu'] / first['cpu']:7.1f}x{row['mean_mm']:9.3f}{row['p95_mm']:8.2f}{row['max_mm']:8.2f}"
            f"{row['truth_mm']:8.2f}{row['flipped']:9.0f}"
        )


def judged(table, kind):
    """Our ratios to the peers against `GOALS`: {what: (ratio, goal)}."""
    ours, peers = table["Head Shop"], {name: row for name, row in table.items() if name != "Head Shop"}
    out = {f"seconds to {n}": (ours["seconds"] / row["seconds"], GOALS[n]) for n, row in peers.items()}
    for column in ("mean_mm", "max_mm") if kind == "whole" else ("truth_mm",):
        out[column] = (ours[column] / min(row[column] for row in peers.values()), GOALS[column])
    return out


def stages(reference, subject):
    """Seconds of each stage of a whole head from a clean scan."""
    begin = time.perf_counter()
    detect(subject.scan)
    out = {"Finding unit and axes": time.perf_counter() - begin}
    return out | timed(build_head(reference, subject.scan, subject.landmarks))[1]


def scaled():
    """Rows of `adapt_scale`, each from a process of its own."""
    rows = []
    for count in COUNTS:
        script = Path(__file__).with_name("adapt_scale.py")
        done = subprocess.run([sys.executable, script, str(count)], capture_output=True, text=True, check=True)
        rows.append(json.loads(done.stdout.splitlines()[-1]))
    return rows


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--people", type=int, default=3, help="people made, each scanned whole and in part")
    parser.add_argument("--folder", help="other scans: NAME_truth.ply, NAME_scan.ply with landmarks NAME_truth.json")
    parser.add_argument("--no-scale", action="store_true", help="leave out how time and memory grow with the scan")
    options = parser.parse_args()
    reference = load_head()
    try:
        import rtree  # noqa: F401 (trimesh looks for the closest triangle with it)
        import trimesh  # noqa: F401

        peers = list(SETTINGS)
    except ImportError as error:
        peers = []
        print(f"no peers: {error} (pip install trimesh rtree)")
    template = Template(reference, drawn(reference.skin.faces, reference.skin.vertices))
    face = reference.groups["face"] > 0.5
    subjects = [s for k in range(options.people) for s in own_subjects(reference, SEED + k)]
    result = {"stages": stages(reference, subjects[1])}
    finish(fit_skin(reference, scan_surface(reference, subjects[0].scan, subjects[0].landmarks), subjects[0].landmarks))
    print(f"{len(subjects[1].scan.faces)} triangles, {len(subjects[1].landmarks)} landmarks")
    for label, seconds in result["stages"].items():
        print(f"  {label:<40}{seconds:8.2f} s")
    for source, some in (("made", subjects), ("folder", folder_subjects(options.folder) if options.folder else [])):
        if not some:
            continue
        rows, chosen, trials = compared(reference, some, template, face, peers)
        result[source] = {"trials": trials}
        for kind, mine in rows.items():
            table = {name: medians(row) for name, row in mine.items()}
            shown = {f"{n} ({chosen[kind, n]})" if (kind, n) in chosen else n: row for n, row in table.items()}
            printed(f"{kind} scans, {source}, medians of {len(mine['Head Shop'])} (mm)", shown)
            goals = judged(table, kind) if peers else {}
            for what, (ratio, goal) in goals.items():
                print(f"  {what:<42}{ratio:9.3f}  (goal {goal:.2f}){'' if ratio <= goal else '  MISSED'}")
            result[source][kind] = {"rows": shown, "ratios": {what: ratio for what, (ratio, _) in goals.items()}}
    if not options.no_scale:
        result["scale"] = scaled()
        print(f"\n{'triangles':>10}{'clean':>9}{'surface':>9}{'skin':>9}{'head':>9}{'peak MB':>9}   (seconds)")
        for row in result["scale"]:
            numbers = "".join(f"{row[key]:9.2f}" for key in ("clean_s", "surface_s", "skin_s", "head_s"))
            print(f"{row['triangles']:>10}{numbers}{row['peak_mb']:9d}")
    print(json.dumps(result))


if __name__ == "__main__":
    main()
