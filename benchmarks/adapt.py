# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast and how well the skin is adapted to scans, beside peers in the same run, and how that grows with the scan.

    python benchmarks/adapt.py [--people 3] [--folder DIR] [--no-scale]

The peers are ``trimesh.registration.nricp_amberg`` and ``nricp_sumner`` (`adapt_peers`), each at the best of several
settings: on the first person all are tried, and the one with the least error is taken for the others.

All adapt the same template. Errors are those of the surface as each method delivers it: ours as it is drawn, subdivided
once, the peers' as the template's own triangles, which is what they register. `SAMPLES` samples, even over the area of the
template's seen part (on partial scans: of its face), are compared with the nearest point of the scan; those that lie
nearest to an open side of it, or more than `REACH` mm away, have no data and are left out. Goals are judged on these.
Peers can also be given the template subdivided once, as fine as what we deliver: a row more for information, at the same
setting, with the seconds that takes, once. Where the person's own skin is known, a partial scan has a row of how far that
lies from it: what the scanner got wrong, nearer than which nothing gets but by fitting noise. Where truth is known,
``truth`` is the mean distance from the template's vertices, the same for all methods, to the point of the subject that each
should have found. Times are from scan and landmarks in memory to the fitted skin, elapsed and of CPU, each the least of
`AGAIN` + 1 runs, of ours and of the peers alike; they compare within a run only. Prints tables and, on the last line, the
same as JSON.
"""

import argparse
import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from adapt_peers import SETTINGS, Finer, Template
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
AGAIN = 4  # times that each is timed once more
SAMPLES, REACH = 40_000, 10.0  # of a surface; mm from the scan
COUNTS = (20_000, 100_000, 500_000, 2_000_000)
FINER = ", subdivided once"  # what a peer with the subdivided template is called
OWN = "the person's own skin"  # what the row of the scan's own errors is called
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
    """The cage (n, 3) mm of our skin for a subject, and the seconds from scan and landmarks to it, elapsed and of CPU."""
    begin, used = time.perf_counter(), time.process_time()
    fit = finish(fit_skin(reference, scan_surface(reference, subject.scan, subject.landmarks), subject.landmarks))
    return fit.cage, {"seconds": time.perf_counter() - begin, "cpu": time.process_time() - used}


def errors(vertices, triangles, subject, scan: Surface, template: Template, face):
    """A row of `COLUMNS` without the seconds, for a fitted surface: vertices (k, 3) mm, the template's n first, and
    ``triangles`` (t, 3), of seen parts only."""
    n = len(template.vertices)
    seen = np.zeros(n, dtype=bool)
    seen[template.used] = True
    if subject.kind == "partial":
        seen &= face
    row = off(sampled(vertices, triangles), scan) | {"truth_mm": np.nan}
    own = template.triangles[seen[template.triangles].all(axis=1)]
    if subject.truth is None:  # beside its neighbours a flipped triangle looks the other way
        row["flipped"] = turned_from_neighbours(vertices[:n], own)
    else:
        row["truth_mm"] = np.linalg.norm(vertices[:n][seen] - subject.truth[seen], axis=1).mean()
        one, other = (normals(v, own) for v in (vertices, subject.truth))
        row["flipped"] = (np.einsum("ij,ij->i", one, other) < 0).sum()
    return {name: float(value) for name, value in row.items()}


def own_errors(vertices, triangles, subject, scan: Surface):
    """A row of `COLUMNS` for the person's own skin, at its points nearest to our samples of a fitted surface."""
    skin = Surface(subject.skin.vertices, subject.skin.triangles).closest(sampled(vertices, triangles), REACH)
    return dict.fromkeys(COLUMNS, np.nan) | off(skin.points[skin.found], scan)


def off(points, scan: Surface):
    """How far points (k, 3) mm that have data lie from the scan: the part of a row that tells of the surface."""
    found = scan.closest(points, REACH)
    # Narrow gaps are holes here as well: no fit is to be the better for what it takes them for.
    on_open = (scan.border_vertex | scan.gap_vertex)[scan.triangles[found.triangle]] & (found.weights > 1e-6)
    near = found.distance[found.found & ~on_open.any(axis=1)]
    return {"mean_mm": float(near.mean()), "p95_mm": float(np.percentile(near, 95)), "max_mm": float(near.max())}


def sampled(vertices, triangles):
    """(`SAMPLES`, 3) mm points, even over the area of triangles (t, 3)."""
    rng = np.random.default_rng(0)
    area = np.linalg.norm(normals(vertices, triangles), axis=1)
    pick = triangles[rng.choice(len(triangles), SAMPLES, p=area / area.sum())]
    share = rng.dirichlet(np.ones(3), SAMPLES)
    return np.einsum("sk,skx->sx", share, vertices[pick])


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
    """Rows of ours and of each peer at its best setting, all kinds: {kind: {name: [row, ...]}}, settings and trials.

    Those of the subdivided template are named after the peer and `FINER`.
    """
    rows, chosen, trials = {}, {}, []
    finer = Finer(template, reference)
    for subject in subjects:
        scan = Surface(subject.scan.vertices, subject.scan.triangles)
        mine = rows.setdefault(subject.kind, {})

        def judged_surface(of, vertices, subject=subject, scan=scan):
            triangles = of.seen_triangles(face if subject.kind == "partial" else None)
            return errors(vertices, triangles, subject, scan, template, face)

        cage, seconds = adapted(reference, subject)
        mine.setdefault("Head Shop", []).append(seconds | judged_surface(finer, finer.rows @ cage))
        if subject.skin is not None and subject.kind == "partial":  # of the whole it is the scan
            mine.setdefault(OWN, []).append(own_errors(finer.rows @ cage, finer.seen_triangles(face), subject, scan))
        for peer in peers:
            names = [chosen[subject.kind, peer]] if (subject.kind, peer) in chosen else list(SETTINGS[peer])
            tried = []
            for name in names:
                vertices, seconds = template.registered(peer, SETTINGS[peer][name], subject)
                row = seconds | judged_surface(template, vertices)
                tried.append((row["mean_mm"] if subject.kind == "whole" else row["truth_mm"], name, row))
                if len(names) > 1:
                    trials.append({"kind": subject.kind, "peer": peer, "setting": name} | row)
            known = [t for t in tried if np.isfinite(t[0])] or [(t[2]["mean_mm"], *t[1:]) for t in tried]
            _, name, best = min(known, key=lambda t: t[0])
            chosen[subject.kind, peer] = name
            mine.setdefault(peer, []).append(best)
            vertices, seconds = finer.registered(peer, SETTINGS[peer][name], subject)
            mine.setdefault(peer + FINER, []).append(seconds | judged_surface(finer, vertices))
        # All of them again and again, in turn: the machine may be busy with something else now and then.
        for _ in range(AGAIN):
            again = {
                peer: template.registered(peer, SETTINGS[peer][chosen[subject.kind, peer]], subject)[1]
                for peer in peers
            }
            for name, seconds in (again | {"Head Shop": adapted(reference, subject)[1]}).items():
                mine[name][-1] |= {clock: min(mine[name][-1][clock], value) for clock, value in seconds.items()}
    for (kind, peer), name in list(chosen.items()):
        chosen[kind, peer + FINER] = name
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
        cells = [(row["seconds"], "9.2f"), (row["seconds"] / first["seconds"], "7.1f", "x"), (row["cpu"], "8.2f")]
        cells += [(row["cpu"] / first["cpu"], "7.1f", "x"), (row["mean_mm"], "9.3f"), (row["p95_mm"], "8.2f")]
        cells += [(row["max_mm"], "8.2f"), (row["truth_mm"], "8.2f"), (row["flipped"], "9.0f")]
        print(f"{name:<44}" + "".join(cell(*c) for c in cells))


def cell(value, shape, unit=""):
    """A number as text, with its unit; a dash, as wide, where there is none."""
    text = f"{value:{shape}}{unit}"
    return text if np.isfinite(value) else f"{'-':>{len(f'{0.0:{shape}}') + len(unit)}}"


def judged(table, kind):
    """Our ratios to the peers against `GOALS`: {what: (ratio, goal)}."""
    ours, peers = table["Head Shop"], {name: row for name, row in table.items() if name in GOALS}
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
    missing = [name for name in ("trimesh", "rtree") if importlib.util.find_spec(name) is None]
    peers = [] if missing else list(SETTINGS)
    if missing:  # trimesh looks for the closest triangle with rtree
        print(f"no peers: pip install {' '.join(missing)}")
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
