# SPDX-License-Identifier: GPL-3.0-or-later
"""The scanned heads of the test data (see `tests/conftest.py`): where each lies and what is known of it."""

import os
from dataclasses import dataclass
from pathlib import Path

TWELVE = tuple(f"{name}_{side}" for name in ("en", "ex", "ch", "al", "t") for side in "lr") + ("prn", "gn")


@dataclass(frozen=True)
class ScannedHead:
    """name : the file's, without its ending; scan : its path; landmarks : file of landmarks, or None; truth : the surface
    that was scanned, or, of a smile, the same person's neutral face, with landmarks_of_truth, or None."""

    name: str
    scan: Path
    landmarks: Path | None = None
    truth: Path | None = None
    landmarks_of_truth: Path | None = None
    smiles: bool = False


def test_data() -> Path:
    """The folder of test data: $HEADSHOP_SHARED, or ``shared`` beside the checkout. Raises SystemExit where it is not."""
    folder = Path(os.environ.get("HEADSHOP_SHARED") or Path(__file__).resolve().parents[2] / "shared")
    if not (folder / "scans").is_dir():
        raise SystemExit(f"no test data at {folder}: set HEADSHOP_SHARED to its folder")
    return folder


def scanned_heads(folder: Path) -> list[ScannedHead]:
    """All of them: virtual scans and clean surfaces of random people, and their smiles; real scans; a CT; heads modelled by
    hand."""
    people = folder / "ict" / "examples"
    heads = []
    for scan in sorted(people.glob("*_scan.ply")):
        name = scan.stem.removesuffix("_scan")
        neutral = name.removesuffix("_smile")
        known = people / f"{name}_truth.json"
        truth, at = people / f"{neutral}_truth.ply", people / f"{neutral}_truth.json"
        heads.append(ScannedHead(name, scan, known, truth, at, smiles=name != neutral))
        if name == neutral:
            heads.append(ScannedHead(f"{name}_clean", truth, at))
    heads.append(ScannedHead("neutral", folder / "ict" / "neutral.ply", folder / "ict" / "neutral.landmarks.json"))
    for scan in sorted((folder / "scans").glob("*.ply")):
        heads.append(ScannedHead(scan.stem, scan, scan.with_suffix(".landmarks.json")))
    scan = folder / "ct_headsq" / "skin.ply"
    heads.append(ScannedHead("ct_headsq", scan, scan.with_suffix(".landmarks.json")))
    heads += [ScannedHead(scan.stem, scan) for scan in sorted((folder / "makehuman").glob("*.ply"))]
    return heads
