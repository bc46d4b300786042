# SPDX-License-Identifier: GPL-3.0-or-later
"""What was fitted and what was invented, in one sentence."""

import numpy as np

from ..anatomy.head import Head
from ..mesh import vertex_areas

#: What is said -> groups of the skin that make it up; ``_l`` and ``_r`` are added where a head has sides.
REGIONS = {
    "forehead": ("forehead",),
    "eyelids": ("lid_upper", "lid_lower"),
    "nose": ("nose",),
    "cheek": ("cheek",),
    "lips": ("lip_upper", "lip_lower"),
    "chin": ("chin",),
    "ear": ("ear",),
    "scalp": ("scalp",),
    "neck": ("neck",),
}
#: Key of what was left out of the scan -> what is said of it.
LEFT_OUT = {
    "depth_jumps": "what is stretched over the jumps of a depth map",
    "flat_ends": "a flat end",
    "held_by_lips": "what the lips hold",
    "hair": "hair",
    "glasses": "glasses",
    "beard": "a beard",
    "clothing": "clothing",
}
#: What is advised where a face whose lips are closed seems to smile.
SMILES_CLOSED = (
    "It seems to smile with its lips closed: to have it neutral, build it with Relax set to Always (--relax always)."
)
SIDED = ("eyelids", "cheek", "ear")
FITTED = 0.3  # a vertex counts as fitted from here on
MOST, ALL = 0.4, 0.1  # share of a region that was fitted, below which it counts as invented for the most part, wholly


def doubts(doubted: dict[str, float]) -> str:
    """What to say of landmarks that are so many mm from where the face in the scan has them (`gate.doubted`)."""
    if not doubted:
        return ""
    if len(doubted) == 1:
        ((name, away),) = doubted.items()
        return f"Check {name}: it lies {away:.0f} mm from where the face in the scan seems to have it."
    *some, last = [f"{name} ({away:.0f} mm)" for name, away in doubted.items()]
    return f"Check {', '.join(some)} and {last}: they lie so far from where the face in the scan seems to have them."


def fitted_shares(head: Head, fitted: np.ndarray) -> dict[str, float]:
    """Region, such as ``left ear`` or ``neck`` -> share of its visible area that the scan decided.

    fitted (n,) 0..1 per skin vertex
    """
    area = vertex_areas(head.skin.vertices, head.skin.triangles)
    n = len(area)

    def weight(name):
        return np.asarray(head.groups.get(name, np.zeros(n)), dtype=float)

    area = area * (weight("inner") <= 0.5)
    out = {}
    for region, groups in REGIONS.items():
        for side, word in (("_l", "left "), ("_r", "right ")) if region in SIDED else (("", ""),):
            inside = np.max([weight(name + side) for name in groups], axis=0) > 0.5
            total = area[inside].sum()
            if total > 0:
                out[word + region] = float(area[inside & (fitted > FITTED)].sum() / total)
    return out


def invented(shares: dict[str, float]) -> list[str]:
    """The regions that the scan did not decide, in words; both sides of a kind together."""

    def said(region, share, article="the "):
        return region if share < ALL else f"most of {article}{region}"

    out = []
    for region in REGIONS:
        if region not in SIDED:
            sides = [region]
        else:
            sides = [f"{side} {region}" for side in ("left", "right")]
        few = {name: shares[name] for name in sides if shares.get(name, 1.0) < MOST}
        if len(few) == 2 and len({share < ALL for share in few.values()}) == 1:
            plural = region if region.endswith("s") else region + "s"
            out.append(said(f"both {plural}", few[sides[0]], ""))
        else:
            out += [said(name, share) for name, share in few.items()]
    return out


def fit_sentence(fit: dict, missing: list[str]) -> str:
    """``Fitted 83 % of the face to 0.14 mm on average (95 % within 0.42 mm); invented: left ear, neck.``

    Where something was: ``...; left out: a flat end; invented: ...``

    fit : the ``fit`` block of the report; missing : what `invented` returns
    """
    said = (
        f"Fitted {100 * fit['coverage']:.0f} % of the face to {fit['mean_mm']:.2f} mm on average "
        f"(95 % within {fit['p95_mm']:.2f} mm)"
    )
    out = [words for key, words in LEFT_OUT.items() if fit.get("left_out_mm2", {}).get(key)]
    if out:
        said = f"{said}; left out: {', '.join(out)}"
    return f"{said}; invented: {', '.join(missing)}." if missing else f"{said}; nothing was invented."
