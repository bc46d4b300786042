# SPDX-License-Identifier: GPL-3.0-or-later
"""How heads differ: the reference skin and the displacements that make other plausible people of it.

A Gaussian process over the skin in low rank (Lüthi et al. 2018, Gaussian process morphable models): the variation of
our own random individuals, which is linear in what they draw (`sim.scan.individual`), smooth displacements on three
scales, much the same left and right, for what their measurements do not name, and the ways in which a scanned face
departs from rest most, an open jaw and a smile. Its mean is the reference with a higher crown.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial import cKDTree

from ..adapt.shut_eyes import with_shut_eyes
from ..anatomy.head import Head
from ..anatomy.landmark_names import SKIN
from ..blas import one_thread
from ..mesh_subdivision import drawn
from ..relax.responses import answers, responses
from ..scan.individual import variation
from .both_sides import MIRROR, alike, near

#: Smooth displacements: reach in mm, standard deviation in mm, whether for the face only.
SCALES = ((90.0, 6.0, False), (45.0, 2.5, False), (24.0, 1.5, True))
#: Correlation of left and right. Without it, the half of a face that a scan lacks was laid as in the likeliest face, whatever
#: the other half is like.
ALIKE = 0.9
#: mm by which the vertex of the likeliest head lies above the reference's, and above nasion in which that sets in. From n to v
#: the reference has .82 of what it has from n to gn; ten heads (MakeHuman's, Lee Perry-Smith's, a mannequin's) and nine of
#: ICT-FaceKit's have .83 to 1.04, .91 on average. With the reference's, crowns that no scan shows were too low on nearly all.
CROWN, ABOVE_NASION = 10.0, 60.0
LEAST = 0.1  # mm: root mean square over the skin of a mode that counts
TOUCH = 2.0  # mm: lips nearer than this touch at rest
SEAL, LIPS = 0.8, 8.0  # mm that closed lips may part, one standard deviation, at so many places of their own
SHUT = 0.7  # how far an eye is shut, one standard deviation
HELD = 0.1  # how far an eye is shut of which it is known whether it is, one standard deviation
OPENED = 1.2  # standard deviations of the jaw by which a mouth is open that is open at all
#: mm by which ears lie farther back and up from the outer corner of the eye than the reference's, on the likeliest head, and
#: how far they vary. Displacements alone vary by 7 and 8 mm there. With those alone 17 heads whose ears were cut away, of
#: MakeHuman, ICT-FaceKit, Lee Perry-Smith and a mannequin, got them 5.1 mm amiss that way and 7.7 too high, so 3.9 and 4.0
#: (root mean squares).
EARS, EARS_VARY = (2.5, -2.0), (4.0, 2.5)
NAPE = (15.0, 25.0)  # mm behind the hindmost point of the ear, and above the chin
MOVED = 3.0  # mm
JAW_OPEN = 0.12  # rad, one standard deviation
#: A smile moves the corners of the mouth outward, back and up, mm; one standard deviation.
SMILE, SMILE_REACH = (4.0, 3.0, 4.0), 20.0


@dataclass(frozen=True, eq=False)
class ShapeSpace:
    """A skin and its variation.

    vertices (n,) : indices of the points among the vertices of the reference's skin
    points (n, 3) mm : outer skin of the reference, as drawn, with the likeliest crown
    modes (n, 3, m) mm : displacement for one standard deviation of each coefficient
    seal (m, m) : quadratic form of lips that part, in standard deviations: small where the mouth is closed
    beside : side -> quadratic form (m, m) of an ear that lies elsewhere beside the eye, and (m,) its pull to where it most
        likely lies
    shut : side -> (m,) coefficients that shut that eye
    lids : side -> (m, m), quadratic form of how far that eye is shut
    parted (m,) : coefficients that open the mouth
    lips : points of the upper lip, and of the lower lip that they touch
    triangles (t, 3) : of the points
    area (n,) mm² : surface around each point
    face, ear (n,) 0..1 : membership
    hairy (n,) bool : skin on which hair grows: the scalp, and the nape behind the ears
    moving (n,) bool : skin that jaw and muscles of the lower face may move by more than `MOVED`
    names (k,) : landmarks; corners (k, 3), weights (k, 3) : where they ride on the points
    size : what the likeliest head has of the points' own
    """

    vertices: np.ndarray
    points: np.ndarray
    modes: np.ndarray
    seal: np.ndarray
    beside: dict[str, tuple[np.ndarray, np.ndarray]]
    shut: dict[str, np.ndarray]
    lids: dict[str, np.ndarray]
    parted: np.ndarray
    lips: tuple[np.ndarray, np.ndarray]
    triangles: np.ndarray
    area: np.ndarray
    face: np.ndarray
    ear: np.ndarray
    hairy: np.ndarray
    moving: np.ndarray
    names: tuple[str, ...]
    corners: np.ndarray
    weights: np.ndarray
    size: float = 1.0

    def on_side(self, side: str) -> np.ndarray:
        """(n,) bool: the points on the subject's left, ``l``, or right, ``r``."""
        return (self.points[:, 0] > 0) == (side == "l")

    @property
    def of_infants(self) -> bool:
        """Whether it is that of `infant.infant_space`."""
        return self.size < 1

    def shaped(self, coefficients: np.ndarray) -> np.ndarray:
        """(n, 3) mm, the skin with ``coefficients`` (m,)."""
        return self.points + (self.modes.reshape(-1, self.modes.shape[2]) @ coefficients).reshape(-1, 3)

    def reduced(self, count: int) -> "ShapeSpace":
        """The same skin with its first ``count`` modes only."""
        shut = {side: vector[:count] for side, vector in self.shut.items()}
        lids = {side: form[:count, :count] for side, form in self.lids.items()}
        return replace(
            self,
            modes=self.modes[:, :, :count],
            seal=self.seal[:count, :count],
            beside={side: (form[:count, :count], pull[:count]) for side, (form, pull) in self.beside.items()},
            shut=shut,
            lids=lids,
            parted=self.parted[:count],
        )

    def landmarks(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """Name -> (3,), the landmarks on ``points`` (n, 3)."""
        at = np.einsum("kij,ki->kj", points[self.corners], self.weights)
        return dict(zip(self.names, at, strict=True))


@lru_cache(maxsize=2)
def shape_space(head: Head) -> ShapeSpace:
    """The shape space of a head at rest, made once."""
    with one_thread():
        return _made(head)


def _made(head: Head) -> ShapeSpace:
    """`shape_space`."""
    skin = head.skin
    whole = drawn(skin.faces, skin.vertices)
    inner = head.groups["inner"] > 0.5
    marks = [k for k, part in enumerate(head.landmarks.part) if part == "skin" and head.landmarks.names[k] in SKIN]
    outside = ~inner
    outside[head.landmarks.corners[marks].ravel()] = True
    index = np.cumsum(outside) - 1
    points = whole[outside]
    triangles = skin.triangles
    triangles = index[triangles[(outside & ~inner)[triangles].all(axis=1)]]
    corners = points[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    area = np.bincount(triangles.ravel(), np.repeat(area, 3), len(points))

    def group(name):
        return np.asarray(head.groups[name], dtype=float)[outside]

    face, ear = group("face"), np.maximum(group("ear_l"), group("ear_r"))
    landmarks = head.landmark_positions()
    modes = [variation(landmarks, points)]
    modes += [_smooth(points, reach, sd, (face > 0.5) | (ear > 0.3) if local else None) for reach, sd, local in SCALES]
    modes.append(_jaw(points, group("jaw"), head))
    modes.append(_smile(points, landmarks))
    modes += [_blink(head, whole, side)[outside] for side in "lr"]
    modes, turn = _principal(np.concatenate(modes, axis=2), area)
    points = _crowned(points, landmarks)
    shut = {side: turn[k - 2] / SHUT for k, side in enumerate("lr")}
    parted = OPENED * turn[-4]
    upper, lower = _lips(points, group("lip_upper") > 0.5, group("lip_lower") > 0.5)
    apart = (modes[upper] - modes[lower]).reshape(-1, modes.shape[2])
    names = tuple(head.landmarks.names[k] for k in marks)
    corners, weights = index[head.landmarks.corners[marks]], head.landmarks.weights[marks]
    riding = dict(zip(names, np.einsum("kijm,ki->kjm", modes[corners], weights), strict=True))
    return ShapeSpace(
        np.flatnonzero(outside),
        points,
        modes,
        apart.T @ apart / (SEAL**2 * len(upper) / LIPS),
        _beside_eyes(riding),
        shut,
        {side: np.outer(way, way) / (way @ way) ** 2 / HELD**2 for side, way in shut.items()},
        parted,
        (upper, lower),
        triangles,
        area,
        face,
        ear,
        (group("scalp") > 0.5) | _nape(points, landmarks) & (np.maximum(face, ear) < 0.1),
        (responses().reach > MOVED)[outside] if answers(head) else np.zeros(len(points), dtype=bool),
        names,
        corners,
        weights,
    )


def _crowned(points, landmarks):
    """A skin's ``points`` (n, 3) mm with its vertex raised by `CROWN`, and what lies above nasion with it."""
    floor = landmarks["n"][2]
    above = np.clip(points[:, 2] - floor, 0, None)
    share = np.clip(above / ABOVE_NASION, 0, 1)
    lift = CROWN * above / (landmarks["v"][2] - floor) * share**2 * (3 - 2 * share)
    return points + lift[:, None] * [0.0, 0.0, 1.0]


def _nape(points, landmarks):
    """(n,) bool, of a skin's ``points`` (n, 3) mm those behind the ears, from where the hair of the nape begins."""
    behind, above = landmarks["pa_l"][1] + NAPE[0], landmarks["gn"][2] + NAPE[1]
    return (points[:, 1] > behind) & (points[:, 2] > above)


def _principal(modes, area):
    """The same Gaussian process in its principal directions, without those that move nothing.

    Returns its modes, and the matrix (m, k) that takes coefficients to the new ones: ``old @ matrix``.
    """
    flat = (modes * np.sqrt(area / area.sum())[:, None, None]).reshape(-1, modes.shape[2])
    variance, turn = np.linalg.eigh(flat.T @ flat)
    turn = turn[:, ::-1][:, np.sqrt(np.maximum(variance[::-1], 0)) > LEAST]
    return modes @ turn, turn


def _lips(points, upper, lower):
    """Vertices of the upper lip and those of the lower lip that they touch."""
    upper, lower = np.flatnonzero(upper), np.flatnonzero(lower)
    distance, nearest = cKDTree(points[lower]).query(points[upper])
    touch = distance < TOUCH
    return upper[touch], lower[nearest[touch]]


def _beside_eyes(riding):
    """`ShapeSpace.beside` where landmarks ride on the modes so: name -> (3, m)."""
    out = {}
    for side in "lr":
        off = (riding[f"t_{side}"] - riding[f"ex_{side}"])[1:] / np.array(EARS_VARY)[:, None] / np.sqrt(2)
        out[side] = off.T @ off, off.T @ np.divide(EARS, EARS_VARY) / np.sqrt(2)  # both ears tell of one thing
    return out


def _smooth(points, reach, sd, where=None):
    """Modes (n, 3, 3 c) of a Gaussian process of the given reach and deviation, exact at c even places (Nyström)."""
    places = points if where is None else points[where]
    centres = places[farthest(places, reach)]
    out = np.zeros((len(points), 3, 3 * len(centres)))
    for axis, sign in enumerate(MIRROR):
        root = cholesky(_together(centres, centres, reach, sign) + 1e-4 * np.eye(len(centres)), lower=True)
        out[:, axis, axis::3] = sd * solve_triangular(root, _together(centres, points, reach, sign), lower=True).T
    return out


def _together(a, b, reach, sign):
    """(j, k) covariance, as a share of the variance, of displacements at ``a`` (j, 3) and ``b`` (k, 3) mm along an axis that
    has that ``sign`` in a mirror. Across the middle (sign -1) those of the middle itself vary little."""

    def deviation(points):
        return np.sqrt(1 + max(sign, 0) * ALIKE * np.exp(-2 * points[:, 0] ** 2 / reach**2))

    return alike(a, b, reach, sign * ALIKE) / np.outer(deviation(a), deviation(b))


def farthest(points: np.ndarray, spacing: float) -> np.ndarray:
    """Indices of points such that none lies farther than ``spacing`` from one of them, each as far as can be."""
    chosen = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    while distance.max() > spacing:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def _jaw(points, jaw, head):
    """The mode (n, 3, 1) of the jaw's hinge, opening."""
    axis = head.jaw.condyle_l - head.jaw.condyle_r
    axis = axis / np.linalg.norm(axis)
    middle = (head.jaw.condyle_l + head.jaw.condyle_r) / 2
    turn = np.cross(axis, points - middle)
    down = np.cross(axis, head.jaw.incisor - middle)[2]
    return (-np.sign(down) * JAW_OPEN * jaw[:, None] * turn)[:, :, None]


def _blink(head, whole, side):
    """The mode (n, 3, 1) of an eye that shuts, for all vertices ``whole`` of the skin."""
    shut = with_shut_eyes(head, (side,)).skin
    return SHUT * (drawn(shut.faces, shut.vertices) - whole)[:, :, None]


def _smile(points, landmarks):
    """The mode (n, 3, 1) of both corners of the mouth drawn outward, back and up."""
    out, back, up = SMILE
    moved = sum(
        near(points, landmarks[name][None], SMILE_REACH) * np.array([side * out, back, up])
        for name, side in (("ch_l", 1.0), ("ch_r", -1.0))
    )
    return moved[:, :, None]
