# SPDX-License-Identifier: GPL-3.0-or-later
"""The points a muscle's path is written in, and the little language of ``assets/tables/muscles.csv``.

A path is ``edge > edge > …`` from origin to insertion; an edge is ``point ~ point``, the places of the first and the
last fibre. A point is a sum of named points, each with an optional weight, and at most one offset in mm on the
subject's left side (lateral, backward, up): ``s:zy*0.7+s:or*0.3+(0,-4,8)``. Prefixes: ``k:`` skin landmark, ``s:``
bone, ``m:`` modiolus, ``e:`` eyeball.
"""

import re

import numpy as np

from ...sim.anatomy.head import Eye
from .mandible import condyle_centre
from .skull import malar_centre
from .skull_depth import BoneSpace

_TERM = re.compile(r"([kmes]:[a-z]+)(?:\*([0-9.]+))?|\(([^()]*)\)")


def left_points(space: BoneSpace, eye: Eye) -> dict[str, np.ndarray]:
    """Prefixed name -> (3,) mm of every point on the left side and the midline."""
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
    # Where the muscles of the mouth corner knot together: about 11 mm beside the corner, halfway into the cheek.
    corner = points["k:ch"] + [8.0, 6.0, -1.5]
    at = space.points[np.linalg.norm(space.points - corner, axis=1).argmin()]
    points["m:modiolus"] = at - 6.0 * space.smooth_normal(at)
    return points


def point(text: str, points: dict[str, np.ndarray]) -> np.ndarray:
    """(3,) mm of one point of a path."""
    at = np.zeros(3)
    rest = _TERM.sub("", text).replace("+", "").strip()
    if rest:
        raise ValueError(f"muscles.csv: cannot read {text!r}")
    for name, weight, offset in _TERM.findall(text):
        at = at + (np.array([float(x) for x in offset.split(",")]) if offset else float(weight or 1) * points[name])
    return at


def path(text: str, points: dict[str, np.ndarray]) -> np.ndarray:
    """(2, k, 3) mm: the corners of the first and the last fibre."""
    edges = [[point(p, points) for p in (edge.split("~") * 2)[:2]] for edge in text.split(">")]
    return np.array(edges).transpose(1, 0, 2)
