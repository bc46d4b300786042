# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin that something hides, where it probably lies: the plausible head laid on the scan, brought to what is seen around it
and on the other side of the face.

How far the scan stands off that head is taken for a Gaussian process on the reference, the same on both sides of it.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from ..mesh import vertex_normals
from .both_sides import MIRROR, alike
from .shape_fit import ShapeFit, pairs
from .shape_space import ShapeSpace

BEHIND, SEEN = 9.0, 3.0  # mm to which a thing hides skin behind it; from which on skin is not seen
#: mm from an unseen part of the face to the scan, at least, as smaller holes are spanned well enough; from there to what is
#: unseen beside it; from a place that is known, about which that tells more.
WIDE, BESIDE, NEAR_KNOWN = 10.0, 15.0, 20.0
NO_DATA = 20.0  # mm from unseen scalp to the scan, at least
TRUSTED = 0.3  # of `ShapeFit.trust`
#: Of `ShapeSpace.ear`: from there on a place tells how this ear is shaped, not where the skin beside it lies.
EARLESS = 0.05
#: mm, of skin behind something, of such of which landmarks tell, and of skin that nothing shows: how far about it is looked,
#: and of heights their deviation and how far they go together. Far from what is seen there are two kinds: ridges and furrows
#: of a brow, say, end soon; as one kind of heights they went on as waves up a forehead that is not seen.
COVERED, TOLD, UNSEEN = (30.0, (2.0, 9.0)), (45.0, (3.0, 20.0)), (60.0, (4.0, 45.0), (2.0, 12.0))
ROUGH = 0.5  # mm: deviation of each height
ALIKE = 0.8  # correlation of left and right


def hidden_skin(space: ShapeSpace, fit: ShapeFit, things, left: Surface, behind: float = BEHIND) -> np.ndarray:
    """(n,) bool: the points of the skin that lie up to so far ``behind`` ``things`` (k, 3) mm, and that the scan without those,
    ``left``, does not show."""
    if len(things) == 0:
        return np.zeros(len(fit.points), dtype=bool)
    _, trust, _ = pairs(space, fit.points, left, SEEN * fit.pose.scale)
    return (trust == 0) & (cKDTree(things).query(fit.points)[0] < behind * fit.pose.scale)


def unseen_scalp(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(n,) bool: the points of the scalp, above the ears' canals, near which the scan ``target`` has nothing."""
    scalp = np.flatnonzero(space.hairy & (space.points[:, 2] > space.landmarks(space.points)["t_l"][2]))
    out = np.zeros(len(fit.points), dtype=bool)
    out[scalp] = ~target.closest(fit.points[scalp], NO_DATA * fit.pose.scale).found
    return out


def unseen_face(space: ShapeSpace, fit: ShapeFit, target: Surface, known=()) -> np.ndarray:
    """(n,) bool: the points of the face that the scan ``target`` lacks, with much beside them, but shows on its other side, and
    that are not near any of the places ``known`` (k, 3) mm."""
    out, scale = np.zeros(len(fit.points), dtype=bool), fit.pose.scale
    _, trust, _ = pairs(space, fit.points, target, SEEN * scale)
    unseen = np.flatnonzero((space.face > 0.5) & (space.ear < EARLESS) & (trust == 0))
    twin = cKDTree(space.points).query(space.points[unseen] * MIRROR)[1]
    unseen = unseen[trust[twin] > 0]
    far = unseen[~target.closest(fit.points[unseen], WIDE * scale).found]
    if len(far):
        out[unseen] = cKDTree(fit.points[far]).query(fit.points[unseen])[0] < BESIDE * scale
    if len(known):
        out &= cKDTree(known).query(fit.points)[0] > NEAR_KNOWN * scale
    return out


def with_hidden_skin(
    space: ShapeSpace, fit: ShapeFit, hidden, left: Surface, heights=COVERED, picks: dict[str, np.ndarray] | None = None
) -> Surface:
    """The scan ``left`` with the ``hidden`` (n,) bool skin in its place, where that probably is.

    heights : `COVERED`, `TOLD` or `UNSEEN`, how those of a scan vary there
    picks : name -> (3,) mm, landmarks that are known there
    """
    about, *kinds = heights
    patch = space.triangles[hidden[space.triangles].any(axis=1)]
    if len(patch) == 0:
        return left
    used, corners = np.unique(patch, return_inverse=True)
    normals = vertex_normals(fit.points, space.triangles)
    place, trust, _ = pairs(space, fit.points, left, 2 * SEEN * fit.pose.scale)
    near = cKDTree(space.points[used]).query(space.points * MIRROR)[0] < about
    near |= cKDTree(space.points[used]).query(space.points)[0] < about
    known = np.flatnonzero(near & (trust > TRUSTED) & (space.ear < EARLESS))
    off = np.einsum("ij,ij->i", place[known] - fit.points[known], normals[known])
    there = space.points[known]
    if picks:
        rows = [space.names.index(name) for name in picks]
        laid, across, picked = (
            np.einsum("kij,ki->kj", field[space.corners[rows]], space.weights[rows])
            for field in (fit.points, normals, space.points)
        )
        off = np.r_[off, np.einsum("ij,ij->i", np.array(list(picks.values())) - laid, across)]
        there = np.concatenate([there, picked])
    out = likeliest_heights(there, off, space.points[used], *kinds)
    points = fit.points[used] + out[:, None] * normals[used]
    return left.beside(points, corners.reshape(-1, 3))


def likeliest_heights(there, off, places, *kinds: tuple[float, float]) -> np.ndarray:
    """(k,) mm: how far a scan most likely stands off at ``places`` (k, 3) mm on the reference, if it does by ``off`` (j,) at
    ``there`` (j, 3) mm. kinds : of heights that add up, deviation and how far they go together, as in `COVERED`."""

    def together(at):
        return sum((spread / kinds[0][0]) ** 2 * alike(at, there, reach, ALIKE) for spread, reach in kinds)

    system = together(there)
    system[np.diag_indices_from(system)] += (ROUGH / kinds[0][0]) ** 2
    return together(places) @ cho_solve(cho_factor(system), off)
