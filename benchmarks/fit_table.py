# SPDX-License-Identifier: GPL-3.0-or-later
"""How well `headshop build` fits each scanned head of the test data: with the landmarks found, with those given, with twelve.

    python benchmarks/fit_table.py -o out/fit                        # everything, which takes most of an hour
    python benchmarks/fit_table.py lps ct -o out/fit --modes found   # some: names that contain one of these

Measured by the test data's ``eval/fit_quality.py``, which see for the definitions; smiles against the same person's neutral
face, in the place of the scan, and the face as it was scanned against the scan; the same "on its skin" against what of the
scan a build takes for skin, where it leaves something out (flat ends, what the lips hold, hair ...). What is built already
is not built again: a run that was cut off goes on. Millimetres, mean / 95th percentile.

    python benchmarks/fit_table.py ct_headsq -o out/open --build="--relax never --leave-out held_by_lips,hair"

measures heads that were built otherwise, here one with its lips as they were held open and its top as it was cut.
"""

import argparse
import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scanned_heads import TWELVE, ScannedHead, scanned_heads, test_data

from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.scan_surface import scan_surface
from headshop.sim.anatomy.storage import load_head
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply, write_ply

MODES = ("found", "given", "twelve")
CORNERS = ("ch_l", "ch_r")
TITLES = (
    "skin to scan",
    "scan to skin",
    "as scanned",
    "on its skin",
    "to truth",
    "truth to skin",
    "in holes",
    "whole head",
    "lm / corner",
)


def main():
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="heads whose name contains one of these (default: all)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of what is built and measured")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES)
    parser.add_argument("--build", type=shlex.split, default=[], help="further options of headshop build (own folder)")
    args = parser.parse_args()
    folder = test_data()
    print(f"{'head':26}{'landmarks':10}" + "".join(f"{title:>13}" for title in TITLES) + "  mesh, bone")
    for head in scanned_heads(folder):
        if args.names and not any(name in head.name for name in args.names):
            continue
        for mode in args.modes:
            if mode == "found" or head.landmarks is not None:
                found = measured(head, mode, args.output, folder, args.build)
                print(f"{head.name:26}{mode:10}" + row(found), flush=True)


def measured(head: ScannedHead, mode: str, output: Path, folder: Path, options: Sequence[str] = ()) -> dict | str:
    """What the script says of ``head``, built with the landmarks of ``mode`` and these ``options``, or why it could not be
    built."""
    out = output / f"{head.name}_{mode}"
    answer = out.with_suffix(".json")
    if answer.is_file():
        return json.loads(answer.read_text())
    out.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "headshop", "build", head.scan, "--detail", "0", "--quiet", *options]
    command += ["-o", out.with_suffix(".blend"), "--export", out]
    if mode != "found":
        command += ["--landmarks", landmarks_of(head, mode, out)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        return done.stderr.strip().splitlines()[-1]
    command = [sys.executable, folder / "eval" / "fit_quality.py"]
    command += [as_neutral(head, out), head.truth] if head.smiles else [out, head.scan]
    if head.truth is not None and not head.smiles:
        command += ["--truth-surface", head.truth]
    known = head.landmarks_of_truth or head.landmarks
    command += [] if known is None else ["--truth-landmarks", known]
    found = told_by(command)
    if (out / "skin_as_scanned.ply").is_file():
        found["as_scanned"] = from_as_scanned(out, head.scan, folder)
    if any(json.loads((out / "report.json").read_text())["fit"]["left_out_mm2"].values()):
        found["on_its_skin"] = from_as_scanned(out, skin_of_scan(head, mode, out), folder)
    answer.write_text(json.dumps(found))
    return found


def told_by(command: list) -> dict:
    """What a script answers."""
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def landmarks_of(head: ScannedHead, mode: str, out: Path) -> Path:
    """The file of landmarks: all that are known, or ``TWELVE`` of them."""
    if mode == "given":
        return head.landmarks
    known = json.loads(head.landmarks.read_text())
    for part in ("landmarks", "sigma_mm"):
        known[part] = {name: value for name, value in known.get(part, {}).items() if name in TWELVE}
    path = out.with_suffix(".landmarks.json")
    path.write_text(json.dumps(known))
    return path


def from_as_scanned(out: Path, scan: Path, folder: Path) -> dict:
    """What the script says of the face of a head that is exported to ``out``, as it was scanned, beside ``scan``."""
    at, relaxed = out / "as_scanned", out / "skin_as_scanned.ply"
    at.mkdir(exist_ok=True)
    shutil.copy(relaxed if relaxed.is_file() else out / "skin.ply", at / "skin.ply")
    shutil.copy(out / "landmarks.json", at)
    return told_by([sys.executable, folder / "eval" / "fit_quality.py", at, scan, "--face-only"])["face"][
        "skin_to_scan"
    ]


def skin_of_scan(head: ScannedHead, mode: str, out: Path) -> Path:
    """The file of what a build of ``head`` with the landmarks of ``mode`` takes for skin, of its scan."""
    reference, scan = load_head(), clean_scan(read_ply(head.scan))[0]
    if mode == "found":
        known = finish(find_landmarks(scan, reference)).sure()
    else:
        known = read_landmarks(landmarks_of(head, mode, out))
    told = known if mode == "found" else ()
    shown = finish(first_look(reference, scan_surface(reference, scan, known), known, found=told, scan=scan)).target
    path = out / "skin_of_scan.ply"
    write_ply(path, Mesh.from_triangles(shown.vertices, shown.triangles))
    return path


def as_neutral(head: ScannedHead, out: Path) -> Path:
    """A smile's relaxed skin and its landmarks where the same person's neutral face was scanned: the folder of them."""
    to_smile, to_neutral = (
        np.array(json.loads(path.read_text())["pose_model_to_scan"])
        for path in (head.landmarks, head.landmarks_of_truth)
    )
    turn = to_neutral @ np.linalg.inv(to_smile)
    moved = out / "as_neutral"
    moved.mkdir(exist_ok=True)
    skin = read_ply(out / "skin.ply")
    write_ply(moved / "skin.ply", Mesh(skin.vertices @ turn[:3, :3].T + turn[:3, 3], skin.faces))
    known = json.loads((out / "landmarks.json").read_text())
    known["landmarks"] = {
        name: (turn[:3, :3] @ place + turn[:3, 3]).tolist() for name, place in known["landmarks"].items()
    }
    (moved / "landmarks.json").write_text(json.dumps(known))
    return moved


def row(found: dict | str) -> str:
    """One line of the table."""
    if isinstance(found, str):
        return "  " + found
    face, truth = found["face"], found.get("truth", {}).get("face", {})
    told = [face["skin_to_scan"], face["scan_to_skin"], found.get("as_scanned"), found.get("on_its_skin")]
    told += [truth.get("skin_to_scan"), truth.get("scan_to_skin")]
    told += [truth.get("in_holes"), found.get("truth", {}).get("head", {}).get("in_holes")]
    line = "".join(f"{pair(value):>13}" for value in told)
    off = found.get("landmarks", {}).get("errors", {})
    corners = [off[name] for name in CORNERS if name in off]
    line += f"{found.get('landmarks', {}).get('mean', float('nan')):7.2f}{max(corners, default=float('nan')):6.2f}"
    mesh, bone = found["mesh"], found.get("anatomy") or {}
    line += f"  {mesh['flipped_edges']} flipped, {mesh['self_intersections']} cut"
    return line + (f", {bone['outside']['count']} outside" if bone else "")


def pair(value: dict | None) -> str:
    """Mean and 95th percentile."""
    return f"{value['mean']:.3f}/{value['p95']:.2f}" if value and value.get("n") else "-"


if __name__ == "__main__":
    main()
