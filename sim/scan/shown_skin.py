# SPDX-License-Identifier: GPL-3.0-or-later
"""How far points of a scan show skin, by their colours: not hair that hangs over its edge, at which the scan ends, or of which
specks are on a scalp that is not seen, nor eyeballs beside their lids.

Whether a point belongs to any is decided only where it may: near skin that is known to be covered, where a scan ends above the
eyes, the scalp, and open eyes.
Thresholds were set on the heads of menpo3d (hair over forehead and temples, whites of eyes painted on the lids),
Infinite-Realities (bald, eyes shut) and VTK (a face without hair, in coloured light); of specks on people of ICT-FaceKit.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh, edges
from .colour_space import LUMINANCE

#: mm from covered skin within which what looks like its cover is held for it wholly, and beyond which not at all; and the same
#: where beards grow, which are no cover: below the ears and in front of them
COVERED, BEARDED = (30.0, 45.0), (12.0, 20.0)
BARE = 10.0  # mm: what lies farther from skin is not taken for it
ABOVE = 40.0  # mm: what lies farther above covered skin says nothing of its cover
#: From the colour of skin, 0, to that of its cover, 1: what looks like skin up to here, and wholly unlike it.
LIKE_SKIN, UNLIKE = 0.15, 0.35
MOST = 0.4  # more of this than a tenth of the skin has: the colours of skin and cover are not to be told apart
FEWEST = 50  # points that a colour is learnt from
#: Share of the scalp below which what is unlike the face's skin there are specks of hair, which the scanner lost elsewhere:
#: .01 to .10 in scans of ten people of ICT-FaceKit, painted with hair; shaved hair on .38 of it says how a scalp looks.
SPECKS = 0.2
#: How unlike, as a logarithm of colour, and in terms of what a hundredth of the face's skin is: .33 to .51 on those faces, the
#: specks .8 and more.
OTHER, OTHERWISE = (0.5, 0.8), 1.5
#: mm from where a scan ends, above the eyes, within which it is hair that is so much darker, as a logarithm of light, than the
#: skin beside it, if that is no farther away than this.
ENDING, DARK_AS_HAIR, SKIN_BESIDE = (10.0, 14.0), (0.45, 0.8), (40.0, 50.0)
REACH = 6.0  # mm about a vertex in which a scan shows its colour
HAIRLINE = (23.0, 28.0)  # mm from the scalp to which specks reach (23 at a temple), and beyond which there are none
#: Parts of a face whose own colours may be as those of hair.
OWN_COLOURS = ("brow", "lid_upper", "lid_lower", "lip_upper", "lip_lower", "nostril")
#: mm from the edges of lids, as above: eyeballs
BESIDE_LIDS = 7.0, 11.0
#: How much cooler than skin, as a logarithm of blue to red, eyeballs are: not less than this, and wholly so
COOL, COOLER = 0.25, 0.45
#: How much darker than skin, as a logarithm of light, what is too dark to have a colour: of this it says less, of that nothing
DARK, DARKER = -2.2, -3.0
OPEN = 2.0  # mm between the lids
LEAST = 0.3  # of a vertex that belongs to a part
CELL = 1.5  # mm: finer colours are those of single hairs and pores
AROUND = 12  # cells that are averaged
DARKEST = 0.002  # linear light, beneath which colours are noise


def shown_skin(points, colour, skin: Mesh, groups, landmarks, eyes, hidden, ends=(), clothed=None) -> np.ndarray:
    """(k,) 0..1: how far ``points`` (k, 3) mm of a scan with linear colours (k, 3) show skin, as far as can be told.

    skin : the head's, where the scan is, upright, facing -Y, with its ``groups`` of vertices, name -> (n,) 0..1
    landmarks : name -> (3,) mm; eyes : of the head, left and right; hidden, clothed : (n,) bool, skin under hair and the like,
    and skin under clothing, each covered by what has a colour, or None
    ends : (m, 3) mm, where the scan ends, see `mesh.ends_of`
    """
    if not len(points):
        return np.ones(0)
    at, mean, count = _cells(points, colour)
    light = np.log(np.maximum(mean, DARKEST))
    trust = 1 - _specks(at, light, skin, groups)
    ear = (landmarks["t_l"] + landmarks["t_r"]) / 2
    beard = (at[:, 2] < ear[2]) & (at[:, 1] < ear[1])
    for covered in (hidden, clothed):
        if covered is not None and np.any(covered):
            trust *= 1 - _cover(at, light, skin, groups, np.asarray(covered, dtype=bool), beard)
    trust *= 1 - _at_ends(at, light, skin, groups, landmarks, np.reshape(ends, (-1, 3)))
    for side, eye in zip("lr", eyes, strict=True):
        if np.linalg.norm(landmarks[f"ps_{side}"] - landmarks[f"pi_{side}"]) > OPEN:
            trust *= 1 - _eyeball(at, light, eye, _margin(skin, groups, side))
    return _smooth(points, at, trust, count)


def _cells(points, colour):
    """Middles (c, 3) of the points in each cell of space that has any, their mean colours (c, 3), and their number (c,)."""
    place = np.floor((points - points.min(axis=0)) / CELL).astype(np.int64)
    _, cell, count = np.unique(place @ [1, 1 << 20, 1 << 40], return_inverse=True, return_counts=True)
    columns = np.concatenate([points, colour], axis=1).T
    mean = np.stack([np.bincount(cell, column) for column in columns], axis=1) / count[:, None]
    return mean[:, :3], mean[:, 3:], count


def _smooth(points, at, trust, count):
    """``trust`` (c,) in cells of ``count`` (c,) points as it is at ``points`` (k, 3): with that of cells around, for borders
    that are not ragged."""
    if (trust == 1).all():
        return np.ones(len(points))
    distance, index = cKDTree(at).query(points, k=min(AROUND, len(at)), workers=-1)
    index = index.reshape(len(points), -1)
    weight = np.exp(-((distance.reshape(index.shape) / CELL) ** 2) / 2) * count[index]
    return (weight * trust[index]).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)


def _cover(points, light, skin, groups, hidden, beard):
    """(k,) 0..1: what looks like that which lies before ``hidden`` skin (n,) and near it, hair for one.

    beard : (k,) bool, where one may grow
    """
    distance, nearest, own, bare = _beside(points, skin, groups)
    away = cKDTree(skin.vertices[hidden]).query(points, distance_upper_bound=COVERED[1], workers=-1)[0]
    cover = hidden[nearest] & (distance < ABOVE)
    bare &= ~hidden[nearest] & ~beard & ~np.isfinite(away)
    if min(cover.sum(), bare.sum()) < FEWEST:
        return np.zeros(len(points))
    middle = np.median(light[bare], axis=0)
    across = np.median(light[cover], axis=0) - middle
    like = (light - middle) @ across / max(across @ across, 1e-12)
    shade = np.quantile(like[bare], 0.9)  # some skin lies in shadow, which makes it alike
    if shade > MOST:
        return np.zeros(len(points))
    low = max(LIKE_SKIN, shade)
    near = np.where(beard, _near(away, BEARDED), _near(away, COVERED)) * ~own
    return _rise(like, low, low + UNLIKE - LIKE_SKIN) * near


def _specks(points, light, skin, groups):
    """(k,) 0..1: what is unlike the face's skin on a scalp that shows little else of its kind."""
    _, _, own, bare = _beside(points, skin, groups)
    if bare.sum() < FEWEST:
        return np.zeros(len(points))
    off = np.linalg.norm(light - np.median(light[bare], axis=0), axis=1)
    usual = max(OTHERWISE * np.quantile(off[bare], 0.99) / OTHER[0], 1.0)
    scalp = groups["scalp"] > 0.5
    away = cKDTree(skin.vertices[scalp]).query(points, distance_upper_bound=HAIRLINE[1], workers=-1)[0]
    there = _near(away, HAIRLINE) * ~own
    unlike = (there > 0.5) & (off > OTHER[0])
    return _rise(off, *np.multiply(OTHER, usual)) * there * _rare(points[unlike], skin, groups)


def _rare(points, skin, groups):
    """Whether little of the scalp is seen to look as these points (k, 3) do, which are unlike skin: else it looks like that."""
    if not len(points):
        return False
    scalp = skin.vertices[groups["scalp"] > 0.5]
    return np.isfinite(cKDTree(points).query(scalp, distance_upper_bound=REACH)[0]).mean() < SPECKS


def _at_ends(points, light, skin, groups, landmarks, ends):
    """(k,) 0..1: what is much darker than the skin beside it, where the scan ``ends`` (m, 3) above the eyes: hair."""
    out = np.zeros(len(points))
    if not len(ends):
        return out
    distance, nearest, own, bare = _beside(points, skin, groups)
    away = cKDTree(ends).query(points, distance_upper_bound=ENDING[1], workers=-1)[0]
    eyes = np.mean([landmarks[f"ex_{side}"][2] for side in "lr"])
    may = (points[:, 2] > eyes) & ~own & (distance < BARE) & (groups["inner"][nearest] < 0.5)
    asked, beside = np.flatnonzero(may & np.isfinite(away)), np.flatnonzero(may & ~np.isfinite(away))
    if not len(asked) or min(len(beside), bare.sum()) < FEWEST:
        return out
    bright = np.log(np.exp(light) @ LUMINANCE)
    distance, index = cKDTree(points[beside]).query(points[asked], k=FEWEST, workers=-1)
    usual = np.median(bright[beside[index]], axis=1)
    near = _near(away[asked], ENDING) * _near(distance[:, -1], SKIN_BESIDE)
    out[asked] = _rise(usual - bright[asked], *DARK_AS_HAIR) * near
    dark = ~own & (bright < np.median(bright[bare]) - DARK_AS_HAIR[0])
    return out * _rare(points[dark], skin, groups)


def _beside(points, skin, groups):
    """Of the skin beside points (k, 3): mm to it (k,), its vertices (k,), whether it may have colours as hair has (k,), and
    whether it is other skin of the face, near enough to show its colour (k,)."""
    distance, nearest = cKDTree(skin.vertices).query(points, workers=-1)
    own = _any(groups, OWN_COLOURS, len(skin.vertices))
    bare = ~own & (groups["face"] > 0.5) & (groups["inner"] < 0.5)
    return distance, nearest, own[nearest], bare[nearest] & (distance < BARE)


def _eyeball(points, light, eye, margin):
    """(k,) 0..1: what is cooler than the skin about an ``eye``, near the ``margin`` (m, 3) of its lids."""
    gaze = eye.gaze / np.linalg.norm(eye.gaze)
    offset = points - eye.centre
    depth = offset @ gaze
    radius = np.linalg.norm(offset - depth[:, None] * gaze, axis=1) / eye.radius
    around = (depth > 0) & (radius > 2.0) & (radius < 3.0)
    if around.sum() < FEWEST:
        return np.zeros(len(points))
    cool, bright = light[:, 2] - light[:, 0], np.log(np.exp(light) @ LUMINANCE)
    cool, bright = cool - np.median(cool[around]), bright - np.median(bright[around])
    low = max(COOL, np.quantile(cool[around], 0.9))
    away = cKDTree(margin).query(points, distance_upper_bound=BESIDE_LIDS[1], workers=-1)[0]
    return _rise(cool, low, low + COOLER - COOL) * _rise(bright, DARKER, DARK) * _near(away, BESIDE_LIDS)


def _margin(skin, groups, side):
    """(m, 3) mm, the edges of the lids of an eye: where what is seen of them ends."""
    lids = _any(groups, (f"lid_upper_{side}", f"lid_lower_{side}"), len(skin.vertices))
    inner = groups["inner"] > 0.5
    pairs = edges(skin.faces)
    pairs = pairs[(inner[pairs[:, 0]] != inner[pairs[:, 1]]) & lids[pairs].any(axis=1)]
    return skin.vertices[np.unique(pairs[~inner[pairs]])]


def _any(groups, names, count):
    """(n,) bool: in any of the groups of these names, on either side."""
    found = [groups[name + side] > LEAST for name in names for side in ("", "_l", "_r") if name + side in groups]
    return np.any(found, axis=0) if found else np.zeros(count, dtype=bool)


def _near(away, reach):
    """1 up to the first of two distances, 0 from the second on."""
    return 1 - _rise(away, *reach)


def _rise(values, low, high):
    """0 up to ``low``, 1 from ``high`` on."""
    return np.clip((values - low) / (high - low), 0, 1)
