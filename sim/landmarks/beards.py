# SPDX-License-Identifier: GPL-3.0-or-later
"""Beards: a scanner sees one as a rough surface off the chin and the cheeks, and it is no skin.

A plausible head laid on the rest of the face (`shape_fit`) tells: where beards grow, what is rough, or stands off that head,
is beard. How thick it is shows once that head is laid on what lies beside it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .looking import SIZE
from .shape_fit import CHANGE, ShapeFit, fit_shape
from .shape_space import ShapeSpace
from .under_hair import AROUND, MANY, MOSTLY, over, varied, within

#: mm on the reference: how far from the middle the upper border of a beard begins to rise, and how steeply; how far it stays
#: below the ears, and goes behind them, and below the chin; and beyond the lips' red.
BESIDE, STEEP, UNDER_EAR, BEHIND, UNDER_CHIN, ROUND_LIPS = 22.0, 0.75, 5.0, 2.0, 35.0, 3.0
AWAY = 0.05  # of `ShapeSpace.ear`, from which on skin is an ear
#: rad by which normals vary, and mm off the head, from which on it may be beard; mm to which it is what lies beside that.
ROUGH, HIGH, ABOUT = 0.2, 2.0, 8.0
BEYOND = 12.0  # mm beside where beards grow, on the cheeks, that one which grows there may reach
#: mm to which a beard may stand off, and from which on what stands off the throat is one that hangs there.
REACH, HANGING = 90.0, 6.0
#: Share of the chin that is so `HIGH` under a beard: of 17, .30 to .85; of a goatee .24, a moustache .08. And of a thick one,
#: .66 and more; a hand on a cheek came to .34.
SHARE, THICK = 0.25, 0.5
ON_IT = 2.0  # mm to a beard within which a landmark that stands off the skin as those that hang do is picked on it
OVER_SKIN = 60.0  # mm behind a beard to which skin is hidden by it
#: Share of the chin that is rough where a beard may be: of those, .71 and more; of smooth scans of 16 faces .24 at most, of
#: noisy ones as much as of beards. And that so rough as only thick beards and very noisy scans are.
MOSTLY_ROUGH, SHAGGY = 0.5, (0.25, 0.8)
#: Per cent of the face between brows and nose that are calmer than what a beard is told from. Brows, lids and the nose are
#: never smooth: of two clean scans .15 and .18 rad, of two frames of depth cameras .50, whose chins had .45 in the middle.
CALM = 10
CHIN = 8.0  # mm below gnathion to which the chin tells that
IN_FACE = 0.3  # of `ShapeSpace.face`


@dataclass(frozen=True, eq=False)
class Beard:
    """above : the `ShapeFit` of the face without regard to it; grows (n,) bool : the points of the skin over which it is;
    hangs (n,) bool : those before which it may hang."""

    above: ShapeFit
    grows: np.ndarray
    hangs: np.ndarray


def grows_beard(space: ShapeSpace) -> np.ndarray:
    """(n,) bool: the points of the skin where beards grow: below a line from the nose to the ears, without the lips' red."""
    marks = space.landmarks(space.points)
    x, y, z = space.points.T
    rising = marks["sn"][2] - 1 + STEEP * np.clip(np.abs(x) - BESIDE, 0, None)
    below = z < np.minimum(rising, marks["t_l"][2] - UNDER_EAR)
    wide, high = marks["ch_l"][0] + ROUND_LIPS, (marks["ls"][2] - marks["li"][2]) / 2 + ROUND_LIPS
    red = (x / wide) ** 2 + ((z - marks["sto"][2]) / high) ** 2 < 1
    there = below & ~red & (z > marks["gn"][2] - UNDER_CHIN)
    return there & (y < marks["t_l"][1] + BEHIND) & (space.ear < AWAY)


def above_beard(space: ShapeSpace) -> ShapeSpace:
    """``space`` in which skin where beards grow counts for nothing."""
    return replace(space, area=np.where(grows_beard(space), 0.0, space.area))


def is_above_beard(space: ShapeSpace) -> bool:
    """Whether that is one of `above_beard`."""
    return not space.area.all()


def template_above(space: ShapeSpace, template: np.ndarray) -> np.ndarray:
    """What of ``template`` (k, 3) mm, points of the reference's face, lies where no beard grows."""
    return template[~grows_beard(space)[cKDTree(space.points).query(template)[1]]]


def lips_beside(space: ShapeSpace) -> np.ndarray:
    """(n,) bool: the points of the face below the nose where no beard grows."""
    return (space.face > 0.5) & ~grows_beard(space) & (space.points[:, 2] < space.landmarks(space.points)["sn"][2])


def rough_chin(space: ShapeSpace, fit: ShapeFit, target: Surface) -> tuple[bool, bool]:
    """Whether the scan ``target`` is so rough about the chin of the face laid on it that there may be a beard; a thick one.

    A scan that is as rough where no beard grows, as the frames of depth cameras are, tells nothing of one by that.
    """
    chin, bare = _chin(space), _bare(space)
    rough = heights(space, fit, target, grows_beard(space) | bare)[1]
    seen = rough[bare & (rough > 0)]
    usual = np.percentile(seen, CALM) if len(seen) else 0.0
    share = [
        space.area[chin & (rough > max(least, usual))].sum() / space.area[chin].sum() for least in (ROUGH, SHAGGY[0])
    ]
    return share[0] > MOSTLY_ROUGH, share[1] > SHAGGY[1]


def thick_beard(space: ShapeSpace, above: ShapeFit, target: Surface) -> Beard:
    """The `Beard` of the scan ``target``, if it has one, as the face laid on it without regard to one tells, ``above``."""
    zone, marks = grows_beard(space), space.landmarks(space.points)
    beyond = cKDTree(space.points[zone]).query(space.points)[0] < BEYOND
    beyond &= (np.abs(space.points[:, 0]) > BESIDE + BEYOND) & (space.ear < AWAY)
    zone = zone | (beyond & (space.points[:, 2] < marks["en_l"][2] - BEYOND))
    high, rough = heights(space, above, target, zone)
    some = zone & ((high > HIGH) | (rough > ROUGH))
    if some.any():
        some = zone & (cKDTree(space.points[some]).query(space.points)[0] < ABOUT)
    x, y, z = space.points.T
    throat = (z < marks["gn"][2]) & (y < marks["t_l"][1] - UNDER_EAR) & (space.ear < AWAY)
    return Beard(above, some, zone | throat)


def heights(space: ShapeSpace, fit: ShapeFit, target: Surface, zone=None):
    """(n,) mm, on a head of the reference's size, by which the scan ``target`` stands off the skin laid on it in a ``zone``
    (n,) bool (None: where beards grow), and (n,) rad by which it is rough, each about every point there; 0 elsewhere."""
    zone = grows_beard(space) if zone is None else zone
    size, coarse = fit.pose.scale, target.coarser()
    middle, near, off, high = over(fit, space, coarse, slice(None, None, max(len(coarse.triangles) // MANY, 1)))
    some = (near >= 0) & ((off**2).sum(axis=1) < 2.0) & zone[near]
    middle, near, off, high = middle[some], near[some], off[some], high[some] / size
    at, out = np.flatnonzero(zone), np.zeros((2, len(zone)))
    if some.any():
        link = within(fit.points[at], fit.points[near], MOSTLY * size)
        count = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)
        out[:, at] = [link @ values / count for values in (high, varied(middle, off, AROUND * size))]
    return out


def beard_over(space: ShapeSpace, beard: Beard | None, target: Surface) -> np.ndarray:
    """(m,) bool: the triangles of the scan ``target`` that are ``beard``; none if that is None."""
    out = np.zeros(len(target.triangles), dtype=bool)
    if beard is None:
        return out
    fit, size = beard.above, beard.above.pose.scale
    skin = Surface(fit.points, space.triangles)
    own = cKDTree(fit.points).query(skin.vertices)[1]  # a surface numbers its vertices anew
    middle = target.vertices[target.triangles].mean(axis=1)
    found = skin.closest(middle, REACH * size)
    use = np.flatnonzero(found.found & ~found.border)
    near = own[skin.triangles[found.triangle[use], found.weights[use].argmax(axis=1)]]
    high = np.einsum("ij,ij->i", middle[use] - found.points[use], found.normals[use])
    out[use] = beard.grows[near] | (beard.hangs[near] & (high > HANGING * size))
    return out


def picked_on(space: ShapeSpace, fit: ShapeFit, beard: Surface, picks: dict[str, np.ndarray]) -> set[str]:
    """The names of ``picks``, name -> (3,) mm, that lie on a ``beard`` well before the skin of ``fit`` below it: they tell
    where its surface is, and nothing of the chin."""
    if not picks:
        return set()
    size, places = fit.pose.scale, np.array(list(picks.values()))
    on = beard.closest(places).distance < ON_IT * size
    on &= Surface(fit.points, space.triangles).closest(places).distance > HANGING * size
    return {name for name, there in zip(picks, on, strict=True) if there}


def fit_beside(space: ShapeSpace, beard: Beard, target: Surface):
    """A generator: yields the fraction done, returns the `ShapeFit` to the scan ``target`` without what may be ``beard``, and
    the share of the chin that stands off that as beards do.

    Raises
    ------
    NoFaceError : too little is left.
    """
    bare = target.without(beard_over(space, beard, target))
    above = beard.above
    fit = yield from fit_shape(space, bare, above.pose, CHANGE, above.coefficients, size=SIZE)
    chin, (high, _) = _chin(space), heights(space, fit, target)
    return fit, float(space.area[chin & (high > HIGH)].sum() / space.area[chin].sum())


def _bare(space):
    """(n,) bool: the points of the face above where beards grow, without the forehead, on which hair may fall."""
    marks = space.landmarks(space.points)
    z = space.points[:, 2]
    between = (z > marks["sn"][2]) & (z < min(marks["sci_l"][2], marks["sci_r"][2]))
    return (space.face > 0.5) & ~grows_beard(space) & between


def _chin(space):
    """(n,) bool: the points of the chin and the cheeks over which beards grow."""
    below = space.landmarks(space.points)["gn"][2] - CHIN
    return grows_beard(space) & (space.face > IN_FACE) & (space.points[:, 2] > below)
