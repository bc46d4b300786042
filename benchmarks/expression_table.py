# SPDX-License-Identifier: GPL-3.0-or-later
"""How near `headshop build` comes to the neutral faces of people who were scanned with an expression.

    python benchmarks/expression_table.py -o out/expressions                          # four people, 64 scans: an hour
    python benchmarks/expression_table.py disgust --people 7301 -o out/expressions    # some

The test data's ``ict/make_ict_subjects.py`` makes random people of ICT-FaceKit, each with its neutral face, and scans of them
with noise, holes and teeth. Measured by ``eval/fit_quality.py``, in the face, against the neutral one. What is built already is
not built again. Millimetres, mean / 95th percentile, and the worse corner of the mouth, if it was found.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
from fit_table import CORNERS, measured, pair
from scanned_heads import ScannedHead, test_data


def _both(**controls: float) -> dict[str, float]:
    """Controls of both sides."""
    return {f"{name}_{side}": value for name, value in controls.items() for side in "LR"}


#: Name -> ICT-FaceKit's controls. On people 7201 to 7206 the rules of `sim.relax` were made; on 7301 to 7304 only that mouths
#: are looked for higher up, and that flakes are no teeth.
EXPRESSIONS = {
    "weak smile": {**_both(mouthSmile=0.35, mouthUpperUp=0.1), "jawOpen": 0.1},
    "smile": {**_both(mouthSmile=0.6, mouthUpperUp=0.2, cheekSquint=0.3), "jawOpen": 0.08},
    "grin": {**_both(mouthSmile=0.9, mouthUpperUp=0.4, cheekSquint=0.6), "jawOpen": 0.12},
    "laugh": {**_both(mouthSmile=0.9, mouthUpperUp=0.3, cheekSquint=0.8, eyeSquint=0.4), "jawOpen": 0.35},
    "smile of one side": {"mouthSmile_L": 0.9, "mouthUpperUp_L": 0.5, "jawOpen": 0.12},
    "surprise": {"jawOpen": 0.45, **_both(browInnerUp=0.8, browOuterUp=0.8, eyeWide=0.7)},
    "shout": {"jawOpen": 0.9, **_both(mouthLowerDown=0.5)},
    "open": {"jawOpen": 0.5},
    "talk": {"jawOpen": 0.25},
    "ajar": {"jawOpen": 0.1},
    "disgust": _both(noseSneer=0.8, mouthUpperUp=0.6, browDown=0.5),
    "bared teeth": _both(mouthUpperUp=0.7, mouthLowerDown=0.7),
    "funnel": {"mouthFunnel": 0.8, "jawOpen": 0.2},
    "sad": {**_both(mouthFrown=0.7), "jawOpen": 0.15},
    "fear": {**_both(mouthStretch=0.8, eyeWide=0.6, browInnerUp=0.5), "jawOpen": 0.3},
    "wail": {**_both(mouthFrown=0.6, browDown=0.4), "jawOpen": 0.6},
}


def main():
    """Make people, build them, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="expressions whose name contains one of these (default: all)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of what is made and measured")
    parser.add_argument("--people", type=int, nargs="+", default=[7301, 7302, 7303, 7304], help="seeds")
    args = parser.parse_args()
    folder = test_data()
    every = []
    print(f"{'expression':20}{'person':>8}{'skin to truth':>16}{'truth to skin':>16}{'corner':>8}")
    for name, controls in EXPRESSIONS.items():
        if args.names and not any(part in name for part in args.names):
            continue
        for seed in args.people:
            found = measured(person(folder, args.output, seed, name, controls), "found", args.output, folder)
            if isinstance(found, str):
                print(f"{name:20}{seed:8}  {found}", flush=True)
                continue
            face, off = found["face"], found["landmarks"]["errors"]
            corner = max((off[mark] for mark in CORNERS if mark in off), default=np.nan)
            every.append((face["skin_to_scan"]["mean"], face["skin_to_scan"]["p95"], corner))
            told = "".join(f"{pair(face[way]):>16}" for way in ("skin_to_scan", "scan_to_skin"))
            print(f"{name:20}{seed:8}{told}{corner:8.2f}", flush=True)
    if every:
        mean, far, corner = np.nanmean(every, axis=0)
        print(f"{f'all {len(every)}':28}{f'{mean:.3f}/{far:.2f}':>16}{corner:24.2f}")


def person(folder: Path, out: Path, seed: int, name: str, controls: dict[str, float]) -> ScannedHead:
    """A person's scan with an expression, and the neutral face; made if it is not there yet."""
    neutral, scanned = out / "neutral", out / name.replace(" ", "_")
    for where, more in ((neutral, []), (scanned, ["--expr", ",".join(f"{k}={v}" for k, v in controls.items())])):
        if not list(where.glob(f"s{seed}*_scan.ply")):
            script, options = folder / "ict" / "make_ict_subjects.py", ["--seed", str(seed), "--out", where]
            subprocess.run([sys.executable, script, *options, *more], check=True, stdout=subprocess.DEVNULL)
    scan, known = (scanned / f"s{seed}_expr_{what}" for what in ("scan.ply", "truth.json"))
    truth, at = (neutral / f"s{seed}_truth.{kind}" for kind in ("ply", "json"))
    return ScannedHead(f"s{seed}_{scanned.name}", scan, known, truth, at, smiles=True)


if __name__ == "__main__":
    main()
