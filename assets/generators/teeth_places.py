# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the teeth stand: sizes of the 32, the dental arches, and the turn of each tooth on its arch.

Sizes after Wheeler's tables (Nelson and Ash, Dental Anatomy). The arch is the beta function of Braun, Hnat, Fender and
Johnson 1998 (Angle Orthodontist 68:29), its exponent fitted to the widths and depths of adult arches; turns follow the
inclinations of Andrews 1972 (American Journal of Orthodontics 62:296), measured from the occlusal plane.
"""

from typing import NamedTuple

import numpy as np

from ...sim.mesh import Mesh


class Tooth(NamedTuple):
    """A permanent tooth: ``form`` (which master), lengths of crown and root, mesiodistal and labiolingual width of
    crown and neck, mm; ``torque`` and ``tip``, the lean of the crown toward the lips and toward the midline, degrees."""

    form: str
    crown: float
    root: float
    md: float
    md_neck: float
    ll: float
    ll_neck: float
    torque: float
    tip: float


UPPER = (
    Tooth("incisor", 10.5, 13.0, 8.5, 7.0, 7.0, 6.0, 22, 5),
    Tooth("incisor", 9.0, 13.0, 6.5, 5.0, 6.0, 5.0, 20, 8),
    Tooth("canine", 10.0, 17.0, 7.5, 5.5, 8.0, 7.0, 12, 8),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 9.0, 8.0, 3, 3),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 9.0, 8.0, 3, 2),
    Tooth("molar", 7.5, 12.5, 10.0, 8.0, 11.0, 10.0, 5, 1),
    Tooth("molar", 7.0, 11.5, 9.0, 7.0, 11.0, 10.0, 7, -3),
    Tooth("molar", 6.5, 11.0, 8.5, 6.5, 10.0, 9.5, 9, -8),
)
LOWER = (
    Tooth("incisor", 9.0, 12.5, 5.0, 3.5, 6.0, 5.3, 15, 1),
    Tooth("incisor", 9.5, 14.0, 5.5, 4.0, 6.5, 5.8, 14, 1),
    Tooth("canine", 11.0, 16.0, 7.0, 5.5, 7.5, 7.0, 6, 4),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 7.5, 6.5, -3, 4),
    Tooth("premolar", 8.0, 14.5, 7.0, 5.0, 8.0, 7.0, -6, 4),
    Tooth("molar", 7.5, 14.0, 11.0, 9.0, 10.5, 9.0, -9, 5),
    Tooth("molar", 7.0, 13.0, 10.5, 8.0, 10.0, 9.0, -11, 8),
    Tooth("molar", 7.0, 11.0, 10.0, 7.5, 9.5, 9.0, -13, 12),
)

#: The line through the contact points: half width and depth mm, and exponent (see `arch`).
UPPER_ARCH, LOWER_ARCH = (26.3, 57.0, 0.43), (23.8, 54.0, 0.43)
#: The lower incisors' edges rise over those of the upper and stand behind them, mm.
OVERBITE, OVERJET = 2.4, 2.4
#: Upper incisors' edges below the line where the lips meet, mm (Vig and Brundo 1978: 2-3 mm show under parted lips).
SHOW = 2.0
#: Fall of the occlusal plane toward the front against the Frankfort horizontal, degrees.
PLANE = 7.0
#: Labial face of the upper incisors behind the line where the lips meet, mm: the lips' thickness.
BEHIND_LIPS = 6.6


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


def contacts(shape: tuple[float, float, float], widths) -> np.ndarray:
    """(len(widths) + 1, 2) points on an arch, from the midline on, as far apart as the teeth are wide."""
    line = arch(shape)
    points, start = [line[0]], 0
    for width in widths:
        far = np.linalg.norm(line[start:] - points[-1], axis=1)
        if far.max() < width:
            points.append(points[-1] + [0, width])  # the arch ends straight
            continue
        k = int(np.argmax(far >= width))
        share = (width - far[k - 1]) / (far[k] - far[k - 1])
        start += k
        points.append(line[start - 1] * (1 - share) + line[start] * share)
    return np.array(points)


def tooth_places(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> dict:
    """``{"upper": [8 x ToothPlace], "lower": [8 x ToothPlace]}`` of the left side, from the midline on, mm.

    Parameters
    ----------
    skin, groups, landmarks : as `make_anatomy` has them
    """
    front = np.array([0.0, landmarks["sto"][1] + BEHIND_LIPS, landmarks["sto"][2] - SHOW])
    return {
        "upper": _row(UPPER, UPPER_ARCH, front + [0, 1.2, 0], -1),
        "lower": _row(LOWER, LOWER_ARCH, front + [0, 1.2 + OVERJET, OVERBITE], +1),
    }


#: Height of the biting edge toward the other row, against the incisors', mm: canine tip, then the curve of Spee.
_EDGE = {-1: (0, -0.5, 0.1, -0.6, -0.8, -0.8, -1.1, -1.6), +1: (0, 0.0, 0.2, -0.9, -1.3, -1.5, -1.2, -0.6)}


def _row(teeth, shape, front, up):
    """Places along an arch whose biting edge starts at ``front``; ``up`` is where the crowns point, +1 or -1 in z."""
    points = contacts(shape, [t.md for t in teeth])
    places = []
    tilt = np.tan(np.radians(PLANE))
    normal = np.array([0.0, -np.sin(np.radians(PLANE)), np.cos(np.radians(PLANE))]) * up
    for tooth, a, b, edge in zip(teeth, points[:-1], points[1:], _EDGE[up], strict=True):
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
        at = front + [middle[0], middle[1], middle[1] * tilt + edge * up]
        places.append(ToothPlace(tooth, at - crown * tooth.crown, np.stack([along, labial, crown])))
    return places
