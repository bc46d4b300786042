# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid a muscle is painted as: the little language of ``assets/tables/muscles.csv`` (Kähler 2002, section 3).

A path is ``row > row > …`` from origin to insertion; a row is ``point ~ point ~ …`` from the first fibre to the last.
A point is a sum of named points, each with an optional weight, and at most one offset in mm on the subject's left side
(lateral, backward, up): ``s:zy*0.7+s:or*0.3+(0,-4,8)``. Prefixes: ``k:`` skin landmark, ``s:`` bone, ``m:`` a node
that several muscles share, ``e:`` eyeball, ``b:`` the lower end of the neck or bust.
"""

import re

import numpy as np

from ...sim.anatomy.head import Eye
from .skull_depth import BoneSpace
from .skull_field import curve
from .skull_marks import condyle_centre, malar_centre

_TERM = re.compile(r"([kmesb]:[a-z]+[0-9]*)(?:\*([0-9.]+))?|\(([^()]*)\)")
_NODE = re.compile(r"m:[a-z]+[0-9]*")

#: The line under the eyebrow where its muscles end in the skin, from the glabella to the tail.
BROW = ("k:g+(2.2,0,3)", "k:g*0.62+k:sci*0.38+(0,0,1)", "k:sci+(-3,0,0.5)", "k:sci*0.45+k:ft*0.55+(0,0,-0.5)",
        "k:ft*0.72+k:ex*0.28+(0.5,0,0)")  # fmt: skip
BROW_NODES, MODIOLUS_NODES = 13, 5


def left_points(space: BoneSpace, eye: Eye) -> dict[str, np.ndarray]:
    """Prefixed name -> (3,) mm of every point on the left side and the midline, the shared nodes not among them."""
    points = {}
    for prefix, positions in (("k", space.landmarks), ("s", space.targets)):
        for name, at in positions.items():
            if not name.endswith("_r"):
                points[f"{prefix}:{name.removesuffix('_l')}"] = np.asarray(at, float)
    condyle, go, po = condyle_centre(space), points["s:go"], points["s:po"]
    points["s:condyle"] = condyle
    points["s:coronoid"] = condyle + [-4.0, -31.0, 1.0]
    points["s:malar"] = malar_centre(space) + [3.0, -5.0, 0.0]
    points["s:mastoid"] = po + [-7.0, 12.0, -20.0]
    points["s:pterygoid"] = np.array([15.0, po[1] - 40.0, po[2] - 24.0])
    points["s:raphe"] = np.array([go[0] - 15.0, go[1] - 29.0, (points["s:pr"][2] + points["s:id"][2]) / 2])
    points["s:hyoid"] = np.array([7.0, points["s:gn"][1] + 38.0, points["s:gn"][2] - 4.0])
    points["e:eye"] = np.asarray(eye.centre, float)
    return points


def point(text: str, points: dict[str, np.ndarray]) -> np.ndarray:
    """(3,) mm of one point of a path.

    Raises
    ------
    ValueError : the text names no point, or cannot be read.
    """
    at = np.zeros(3)
    rest = _TERM.sub("", text).replace("+", "").strip()
    terms = _TERM.findall(text)
    unknown = [name for name, _, offset in terms if not offset and name not in points]
    if rest or unknown or not terms:
        raise ValueError(f"muscles.csv: cannot read {text!r}")
    for name, weight, offset in terms:
        at = at + (np.array([float(x) for x in offset.split(",")]) if offset else float(weight or 1) * points[name])
    return at


def grid_rows(text: str, points: dict[str, np.ndarray], count: int) -> np.ndarray:
    """(rows, count, 3) mm: where ``count`` fibres cross each row of a path."""
    return np.array([_across(row.split("~"), points, count) for row in text.split(">")])


def shared_ends(text: str, count: int) -> list[str | None]:
    """The node each of ``count`` fibres ends in (``m:…`` alone), or None where it ends in a place of its own."""
    row = [p.strip() for p in text.split(">")[-1].split("~")]
    nearest = np.round(np.arange(count) * (len(row) - 1) / max(count - 1, 1)).astype(int)
    return [row[k] if _NODE.fullmatch(row[k]) else None for k in nearest]


def _across(row, points, count):
    corners = np.array([point(p, points) for p in row])
    if any(_NODE.fullmatch(p.strip()) for p in row):  # nodes are met exactly
        return corners[np.round(np.arange(count) * (len(row) - 1) / max(count - 1, 1)).astype(int)]
    return curve(corners, count) if len(corners) > 1 else np.repeat(corners, count, axis=0)
