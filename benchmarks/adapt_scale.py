# SPDX-License-Identifier: GPL-3.0-or-later
"""How adaptation grows with the scan: seconds per stage and the most memory, for one number of triangles.

    python benchmarks/adapt_scale.py 2000000

A process of its own for each, since a process never gives back its peak. Prints one line of JSON.
"""

import json
import resource
import sys
import time

from adapt_subjects import surface_of

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.scan_surface import scan_surface
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.anatomy.storage import load_head
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan


def peak_mb() -> float:
    """The most memory this process has held, MB."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (1e6 if sys.platform == "darwin" else 1e3)


def main(count: int):
    """Measure, print."""
    reference = load_head()
    scan, landmarks = surface_of(reference, count)
    row = {"triangles": len(scan.faces), "made_mb": round(peak_mb())}
    begin = time.perf_counter()
    scan, _ = clean_scan(scan)
    row["clean_s"] = time.perf_counter() - begin
    begin = time.perf_counter()
    target = scan_surface(reference, scan, landmarks)
    row["surface_s"] = time.perf_counter() - begin
    finish(fit_skin(reference, target, landmarks))
    row["skin_s"] = time.perf_counter() - begin
    del target
    begin = time.perf_counter()
    finish(build_head(reference, scan, landmarks))
    row["head_s"] = time.perf_counter() - begin
    row["peak_mb"] = round(peak_mb())
    print(json.dumps(row))


if __name__ == "__main__":
    main(int(sys.argv[1]))
