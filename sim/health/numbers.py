# SPDX-License-Identifier: GPL-3.0-or-later
"""All numbers of a head, and the limits a sound one keeps."""

from dataclasses import dataclass

from ..anatomy.head import Head
from . import cuts, eyes, mouth, muscles, texture, topology
from .bone import BONES, bone_cover

#: Number -> least and most of it (None: no bound).
LIMITS: dict[str, tuple[float | None, float | None]] = {
    "skin vertices": (1500, 2500),
    "skin quads": (0.97, None),
    "skin self-cuts": (0, 0),
    "smooth skin self-cuts": (0, 0),
    "parts' cuts": (0, 0),
    "smooth skin's cuts": (0, 0),
    "lid gap least": (0, 0.5),
    "lid gap most": (0, 0.5),
    "smooth lid gap least": (0, 0.5),
    "smooth lid gap most": (0, 0.5),
    "eyeball off sphere": (0, 0.01),
    "teeth, tongue outside bag": (0, 0),
    "teeth off rigid": (0, 0.01),
    "bone outside": (0, 0),
    "bone cover": (1.0, None),
    "bone to lining": (1.0, None),
    "muscles out of room": (0, 0),
    "muscle out of skin": (0, muscles.TOUCH),
    "muscle in bone": (0, muscles.SLACK),
    "uv overlaps": (0, 0),
    "uv turned over": (0, 0),
}


@dataclass(frozen=True)
class Numbers:
    """values : number -> value (mm, counts, shares); details : number -> what is behind it, in words."""

    values: dict[str, float]
    details: dict[str, str]

    def faults(self) -> dict[str, float]:
        """The numbers outside their limits."""
        out = {}
        for name, value in self.values.items():
            low, high = LIMITS[name]
            if (low is not None and value < low) or (high is not None and value > high):
                out[name] = value
        return out


def numbers(head: Head, reference: Head | None = None) -> Numbers:
    """The `Numbers` of a head; ``reference`` is what its teeth are compared with (None: they are not)."""
    skin = head.skin
    values: dict[str, float] = {"skin vertices": len(skin.vertices), "skin quads": topology.quad_share(skin)}
    details = {}
    smooth = cuts.smooth_skin(skin)
    values["skin self-cuts"] = cuts.self_cuts(skin)
    between, drawn = cuts.cuts(head), cuts.smooth_cuts(head, smooth)
    values["smooth skin self-cuts"] = drawn.pop("skin", 0)
    values["parts' cuts"], values["smooth skin's cuts"] = sum(between.values()), sum(drawn.values())
    details["parts' cuts"] = ", ".join(f"{a} x {b} {n}" for (a, b), n in between.items())
    details["smooth skin's cuts"] = ", ".join(f"{part} {n}" for part, n in drawn.items())
    for name, positions in (("lid gap", None), ("smooth lid gap", smooth.vertices)):
        gaps = [eyes.lid_gaps(head, side, positions) for side in "lr"]
        values[f"{name} least"] = min(float(g.min()) for g in gaps)
        values[f"{name} most"] = max(float(g.max()) for g in gaps)
    values["eyeball off sphere"] = max(eyes.roundness(head, side) for side in "lr")
    lost = {part: mouth.outside_bag(head, part) for part in mouth.IN_MOUTH}
    values["teeth, tongue outside bag"] = sum(lost.values())
    details["teeth, tongue outside bag"] = ", ".join(f"{part} {n}" for part, n in lost.items() if n)
    if reference is not None:
        values["teeth off rigid"] = max(mouth.rigidity(head, reference, part) for part in mouth.IN_MOUTH[:2])
    cover = {part: bone_cover(head, part) for part in BONES}
    values["bone outside"] = sum(c[2] for c in cover.values())
    values["bone cover"] = min(c[0] for c in cover.values())
    values["bone to lining"] = min(c[1] for c in cover.values())
    details["bone cover"] = ", ".join(f"{part} {c[0]:.2f} seen {c[1]:.2f} lining" for part, c in cover.items())
    room = muscles.muscle_room(head)
    values["muscles out of room"] = len(room)
    values["muscle out of skin"] = max((w[0] for w in room.values()), default=0.0)
    values["muscle in bone"] = max((w[1] for w in room.values()), default=0.0)
    worst = sorted(room.items(), key=lambda item: -max(item[1]))
    details["muscles out of room"] = ", ".join(f"{n} skin {out:.1f} bone {dip:.1f}" for n, (out, dip) in worst)
    values["uv overlaps"], values["uv turned over"] = texture.uv_overlap(skin)
    return Numbers(values, {name: text for name, text in details.items() if text})
