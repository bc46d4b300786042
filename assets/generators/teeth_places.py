# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the teeth stand: the dental arches, and the turn of each tooth on its arch.

The arch is the beta function of Braun, Hnat, Fender and Johnson 1998 (Angle Orthodontist 68:29), its exponent fitted to
the widths and depths of adult arches; the turns were chosen near those of Andrews 1972 (American Journal of
Orthodontics 62:296).
"""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from ...sim.mesh import Mesh
from .teeth_shape import tooth_mesh
from .teeth_sizes import LOWER, UPPER, Tooth

#: The line through the contact points: half width and depth mm, and exponent (see `arch`).
UPPER_ARCH, LOWER_ARCH = (26.3, 57.0, 0.43), (23.5, 54.0, 0.37)
#: The lower incisors' edges rise over those of the upper and stand behind them, mm.
OVERBITE, OVERJET = 2.4, 2.7
#: Height of the biting edge toward the other row, against the incisors', mm: canine tip, then the curve of Spee. The
#: lower back teeth start from here and rise or fall until they meet the upper ones.
_EDGE = {-1: (0, -0.5, 0.1, -0.6, -0.8, -0.8, -1.1, -1.6), +1: (0, 0.0, 0.2, -0.9, -1.3, -1.5, -1.2, -0.6)}
#: Upper incisors' edges below the line where the lips meet, mm (Vig and Brundo 1978: 2-3 mm show under parted lips).
SHOW = 2.0
#: Fall of the occlusal plane toward the front against the Frankfort horizontal, degrees.
PLANE = 7.0
#: Labial face of the upper incisors behind the line where the lips meet, mm: the lips' thickness.
BEHIND_LIPS = 5.6


class ToothPlace(NamedTuple):
    """A tooth in its place (left side): see `tooth_places`.

    tooth : its sizes
    neck : (3,) mm, middle of the neck, where crown and root meet
    axes : (3, 3) rows are unit vectors: distal, labial, and from root to crown
    """

    tooth: Tooth
    neck: np.ndarray
    axes: np.ndarray

    @property
    def out(self) -> np.ndarray:
        """(2,) unit direction in plan to the lip or cheek."""
        flat = self.axes[1, :2]
        return flat / np.linalg.norm(flat)

    @property
    def axis(self) -> np.ndarray:
        """(3,) unit vector from the neck toward the tip of the root."""
        return -self.axes[2]

    @property
    def md_neck(self) -> float:
        """Whole mesiodistal width at the neck, mm."""
        return self.tooth.md_neck

    @property
    def ll_neck(self) -> float:
        """Whole labiolingual width at the neck, mm."""
        return self.tooth.ll_neck


def arch(shape: tuple[float, float, float], count: int = 2000) -> np.ndarray:
    """(count, 2) the left half of an arch in plan: mm lateral, mm behind its front (Braun et al. 1998, equation 1)."""
    half, depth, power = shape
    turn = np.linspace(0, np.pi / 2, count)
    return np.stack([half * np.sin(turn), depth * (1 - np.cos(turn) ** (2 * power))], axis=1)


class _Line:
    """An arch to walk along: where a tooth stands that starts at a given way from the midline."""

    def __init__(self, shape):
        line = arch(shape)
        line = np.concatenate([line[1:2] * [-1, 1], line, line[-1:] + [[0, 15.0]]])  # the arch ends straight
        step = np.linalg.norm(np.diff(line, axis=0), axis=1)
        self._line, self._way = line, np.append(0, np.cumsum(step)) - step[0]

    def at(self, way):
        """(2,) point at ``way`` mm from the midline."""
        return np.array([np.interp(way, self._way, self._line[:, k]) for k in (0, 1)])

    def end(self, start, width):
        """The way at which a chord of ``width`` mm from ``start`` ends."""
        low, high = start + width, start + 1.2 * width
        for _ in range(30):
            middle = (low + high) / 2
            short = np.linalg.norm(self.at(middle) - self.at(start)) < width
            low, high = (middle, high) if short else (low, middle)
        return low


def tooth_places(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> dict:
    """``{"upper": [8 x ToothPlace], "lower": [8 x ToothPlace]}`` of the left side, from the midline on, mm.

    Neighbours touch, and the lower teeth meet the upper ones.

    Parameters
    ----------
    skin, groups, landmarks : as `make_anatomy` has them
    """
    return tooth_rows(landmarks["sto"])


def tooth_rows(stomion: np.ndarray) -> dict:
    """`tooth_places` behind lips whose line has its middle at ``stomion`` (3,) mm."""
    front = np.array([0.0, stomion[1] + BEHIND_LIPS, stomion[2] - SHOW])
    return {row: [p._replace(neck=p.neck + front) for p in places] for row, places in _rows().items()}


def neck_line(places: list, shares: np.ndarray, past: float, way: int, stand: float, apical: np.ndarray) -> np.ndarray:
    """(k + 1, 3) mm on a line outside (``way`` +1) or inside (-1) of the necks of a row's left half.

    shares : (k,) of the way from the midline to the last molar, measured through the middles of the necks
    past : mm from that molar's neck to the last point
    stand, apical : mm off the necks' faces, and, (k + 1, 1), from the necks toward the roots
    """
    neck, axis = np.array([p.neck for p in places]), np.array([p.axis for p in places])
    face = neck + [way * (p.ll_neck / 2 + stand) * p.axes[1] for p in places]
    path = np.concatenate([neck[:1] * [-1, 1, 1], neck])
    at = np.append(0, np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)))
    at -= at[1] / 2
    along = np.append(shares * at[-1], at[-1])
    flip = np.array([-1.0, 1, 1])
    points, down = (
        np.stack([np.interp(along, at, c) for c in np.concatenate([line[:1] * flip, line]).T], axis=1)
        for line in (face, axis)
    )
    points[-1] += (places[-1].md_neck / 2 + past) * places[-1].axes[0]
    return points + apical * down


@cache
def _rows():
    """Both rows, the labial edge of the upper incisors at the origin."""
    from .teeth_contact import Touch

    upper = _row(UPPER, UPPER_ARCH, np.array([0, 1.4, 0]), -1, _EDGE[-1])
    lower_front = np.array([0, 1.4 + OVERJET, OVERBITE])
    rise = np.array(_EDGE[+1], float)
    above = Touch(upper + [mirrored(upper[0])])
    for _ in range(3):
        lower = _row(LOWER, LOWER_ARCH, lower_front, +1, rise)
        rise = rise + [_seat(above, place, front=k < 2) for k, place in enumerate(lower)]
    lower = _row(LOWER, LOWER_ARCH, lower_front, +1, rise)
    return {"upper": upper, "lower": lower}


def mirrored(place: ToothPlace) -> ToothPlace:
    """The same tooth on the right side."""
    flip = np.array([-1.0, 1, 1])
    return place._replace(neck=place.neck * flip, axes=place.axes * flip)


def _seat(above, place, front):
    """mm a lower tooth may rise until it meets the upper row; front teeth only give way."""
    from .teeth_contact import first_touch

    lift = first_touch(lambda z: above.gap(place._replace(neck=place.neck + [0, 0, z])), -2.5, 2.5)
    return min(lift, 0.0) if front else lift


def _row(teeth, shape, front, up, edges):
    """Places along an arch whose biting edge starts at ``front``, each tooth touching the one before it.

    up : where the crowns point, +1 or -1 in z; edges : heights of the biting edges toward the other row, mm
    """
    from .teeth_contact import CONTACT, Touch, first_touch

    line, places, start = _Line(shape), [], 0.0

    def place(tooth, edge, way):
        return _place(tooth, line.at(way), line.at(line.end(way, tooth.md)), front, up, edge)

    for tooth, edge in zip(teeth, edges, strict=True):
        at = partial(place, tooth, edge)
        before = Touch(places[-1:]) if places else None
        if before is None:
            # the middle incisors touch their own mirror images
            way = -first_touch(partial(_mirror_gap, at), -1.0, 0.5)
        else:
            way = start - first_touch(partial(_gap, before, at, start), -1.2, 1.0)
        places.append(at(way))
        if before is None:
            places[0] = places[0]._replace(neck=places[0].neck + [CONTACT / 2 - _innermost(places[0]), 0, 0])
        start = line.end(way, tooth.md)
    return places


def _mirror_gap(at, way):
    """mm between the tooth ``at`` puts ``way`` before the midline and its mirror image."""
    from .teeth_contact import Touch

    return Touch([at(-way)], mirrored=True).gap(at(-way))


def _gap(before, at, start, way):
    """mm between the tooth ``before`` and the one ``at`` puts ``way`` nearer than ``start``."""
    return before.gap(at(start - way))


def _innermost(place):
    """x of the crown's point nearest to the midline, mm."""
    vertices = tooth_mesh(place.tooth)[0]
    return float((vertices[vertices[:, 2] > 0] @ place.axes + place.neck)[:, 0].min())


def _place(tooth, a, b, front, up, edge):
    """A tooth whose contact points lie over ``a`` and ``b`` (2,) of the arch."""
    tilt = np.radians(PLANE)
    normal = np.array([0.0, -np.sin(tilt), np.cos(tilt)]) * up
    middle = (a + b) / 2
    along = np.append(b - a, 0.0)
    along -= along @ normal * normal
    along /= np.linalg.norm(along)
    out = np.cross(along, normal) * up
    s, c = np.sin(np.radians(tooth.torque)), np.cos(np.radians(tooth.torque))
    crown = c * normal + s * out
    labial = np.cross(along, crown) * up
    s, c = np.sin(np.radians(tooth.tip)), np.cos(np.radians(tooth.tip))
    crown, along = c * crown - s * along, c * along + s * crown
    at = front + [middle[0], middle[1], middle[1] * np.tan(tilt) + edge * up]
    return ToothPlace(tooth, at - crown * tooth.crown, np.stack([along, labial, crown]))
