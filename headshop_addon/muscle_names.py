# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of muscles and controls for sliders: which there are, what to call them, where on the face they belong."""

import json
from functools import cache

#: Region of the face -> beginnings of the names of its muscles, in the order of the sidebar.
REGIONS = {
    "Forehead and Brows": ("frontalis", "corrugator", "lateral_corrugator", "depressor_supercilii", "procerus"),
    "Eyes": ("orbicularis_oculi", "levator_palpebrae"),
    "Nose": ("levator_labii_alaeque_nasi", "nasalis", "depressor_septi"),
    "Cheeks and Upper Lip": (
        *("levator_labii_superioris", "zygomaticus", "levator_anguli_oris", "risorius", "buccinator"),
        "incisivus_labii_superioris",
    ),
    "Lips": ("orbicularis_oris",),
    "Lower Lip and Chin": (
        *("depressor_anguli_oris", "depressor_labii_inferioris", "mentalis", "incisivus_labii_inferioris"),
    ),
    "Jaw and Neck": ("masseter", "temporalis", "pterygoideus", "digastricus", "platysma"),
    "Scalp and Ears": ("occipitalis", "auricularis"),
}

#: Control -> label, lowest value, what 1 means.
CONTROLS = {
    "jaw_open": ("Open", 0.0, "Jaw opened as far as its hinge goes"),
    "jaw_forward": ("Forward", -1.0, "Jaw pushed forward"),
    "jaw_side": ("Sideways", -1.0, "Jaw moved to the subject's left"),
    "blink_l": ("Blink Left", 0.0, "Left lids closed"),
    "blink_r": ("Blink Right", 0.0, "Right lids closed"),
    "gaze_x": ("Look Sideways", -1.0, "Both eyes turned to the subject's left"),
    "gaze_z": ("Look Up", -1.0, "Both eyes turned up"),
    "gaze_l_x": ("Left Eye Sideways", -1.0, "Left eye turned to the subject's left, besides both"),
    "gaze_l_z": ("Left Eye Up", -1.0, "Left eye turned up, besides both"),
    "gaze_r_x": ("Right Eye Sideways", -1.0, "Right eye turned to the subject's left, besides both"),
    "gaze_r_z": ("Right Eye Up", -1.0, "Right eye turned up, besides both"),
    "lip_upper_forward": ("Upper Lip Forward", -1.0, "Where the sphincter of the upper lip pulls it when contracted"),
    "lip_lower_forward": ("Lower Lip Forward", -1.0, "Where the sphincter of the lower lip pulls it when contracted"),
    "lips_together": ("Lips Together", 0.0, "Lips held together where they touch, also over an open jaw"),
    "cheek_puff": ("Puff Cheeks", -1.0, "Pressure of the air in the mouth; negative sucks the cheeks in"),
    "tongue_out": ("Tongue Out", 0.0, "Tongue put out between the teeth: open the jaw a little for it"),
}


@cache
def muscles() -> tuple[str, ...]:
    """Every muscle of the reference head, in its order; heads made from it have the same."""
    import numpy as np

    from ..sim.anatomy import storage

    with np.load(storage.REFERENCE) as file:
        document = json.loads(str(file["anatomy"]))
    return tuple(muscle["name"] for muscle in document["muscles"])


def base(name: str) -> str:
    """``zygomaticus_major_l`` -> ``zygomaticus_major``."""
    return name[:-2] if name.endswith(("_l", "_r")) else name


def label(name: str) -> str:
    """``zygomaticus_major_l`` -> ``Zygomaticus Major Left``."""
    side = {"_l": " Left", "_r": " Right"}.get(name[-2:], "")
    return base(name).replace("_", " ").title() + side


def region(name: str) -> str:
    """The region a muscle belongs to; ``Other`` where no region names it."""
    found = [(len(start), region) for region, starts in REGIONS.items() for start in starts if name.startswith(start)]
    return max(found)[1] if found else "Other"


def by_region() -> dict[str, list[tuple[str, ...]]]:
    """Region -> rows of the sidebar: (name,) of a muscle of the midline, or (right, left) as one sees the face."""
    rows: dict[str, dict[str, list[str]]] = {}
    for name in muscles():
        rows.setdefault(region(name), {}).setdefault(base(name), []).append(name)
    order = [*REGIONS, "Other"]
    return {
        region: [tuple(sorted(names, reverse=True)) for names in rows[region].values()]
        for region in sorted(rows, key=order.index)
    }
