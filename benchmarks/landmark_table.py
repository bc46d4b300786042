# SPDX-License-Identifier: GPL-3.0-or-later
"""How far `headshop landmarks` is off on each scanned head of the test data, as it lies and turned at random.

    python benchmarks/landmark_table.py -o out/landmarks          # all heads with known landmarks
    python benchmarks/landmark_table.py -o out/landmarks lps ct   # those whose name contains one of these

Distances to the known landmarks, weighed by one over the square of their ``sigma_mm`` where the file has it. Face: without
those of the ears, the scalp and the angle of the jaw. What is found already is not looked for again. Millimetres.
"""

import argparse
import json
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
from scanned_heads import ScannedHead, scanned_heads, test_data
from scipy.spatial.transform import Rotation

from headshop.sim.mesh import Mesh
from headshop.sim.scan.ply import read_ply, write_ply

NOT_FACE = {"v", "op", "eu", "t", "go", "sa", "sba", "pa", "pra", "obs", "obi"}


def main():
    """Find, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="heads whose name contains one of these (default: all)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of what is found")
    args = parser.parse_args()
    print(f"{'head':18}{'':10}{'face':>7}{'all':>7}{'worst':>15}  on the wrong side")
    for head in scanned_heads(test_data()):
        if head.landmarks is None or args.names and not any(name in head.name for name in args.names):
            continue
        for turned in (False, True):
            print(
                f"{head.name:18}{'turned' if turned else 'as it is':10}" + row(*found(head, turned, args.output)),
                flush=True,
            )


def found(head: ScannedHead, turned: bool, output: Path) -> tuple[dict, dict, dict]:
    """The landmarks found, where the scan lies, those known, and their sigmas."""
    out = output / f"{head.name}{'_turned' if turned else ''}.json"
    turn = Rotation.random(random_state=zlib.crc32(head.name.encode())).as_matrix() if turned else np.eye(3)
    if not out.is_file():
        out.parent.mkdir(parents=True, exist_ok=True)
        scan = head.scan
        if turned:
            mesh, scan = read_ply(head.scan), out.with_suffix(".ply")
            write_ply(scan, Mesh(mesh.vertices @ turn.T, mesh.faces))
        command = [sys.executable, "-m", "headshop", "landmarks", scan, "-o", out, "--quiet"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{head.name}: {done.stderr.strip()}")
    document, known = json.loads(out.read_text()), json.loads(head.landmarks.read_text())
    places = {name: np.array(place) @ turn for name, place in document["landmarks"].items()}
    return places, {name: np.array(place) for name, place in known["landmarks"].items()}, known.get("sigma_mm", {})


def row(places: dict, known: dict, sigma: dict) -> str:
    """One line of the table."""
    names = [name for name in known if name in places]
    error = np.array([np.linalg.norm(places[name] - known[name]) for name in names])
    weight = np.array([sigma.get(name, 1.0) for name in names]) ** -2.0
    face = np.array([name.split("_")[0] not in NOT_FACE for name in names])
    worst = int(error.argmax())
    line = f"{np.average(error[face], weights=weight[face]):7.2f}{np.average(error, weights=weight):7.2f}"
    return line + f"{names[worst]:>9}{error[worst]:6.1f}  {', '.join(swapped(places, known)) or '-'}"


def swapped(places: dict, known: dict) -> list[str]:
    """Those that lie nearer to where their other side's belongs."""
    other = {name: name[:-1] + {"l": "r", "r": "l"}[name[-1]] for name in known if name[-2:] in ("_l", "_r")}
    pairs = [(name, twin) for name, twin in other.items() if name in places and twin in known]
    return [a for a, b in pairs if np.linalg.norm(places[a] - known[b]) < np.linalg.norm(places[a] - known[a])]


if __name__ == "__main__":
    main()
