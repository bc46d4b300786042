# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs stay spheres: their place and size follow from the lids that lie on them."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..anatomy.eyeball import BALL
from ..anatomy.head import Eye, Head
from ..mesh import Mesh
from ..progress import Work
from .flesh import clearing
from .lid_contact import BACK, SEEN, LidContact, height_over
from .refine import thinned
from .thin_plate_spline import System, similarity

if TYPE_CHECKING:
    from .rest import Rest

SMALLEST, LARGEST = 9.5, 13.0  # mm: from a child of one year to a large adult eye
#: Along an eye from its inner corner: where the inner edge of the lids lies on the ball, and over which length it begins to.
LIES, BEGINS = (0.22, 0.94), 0.03
EDGES = (0.08, 0.97)  # where it does on any head
BACKS = 1  # edges behind the rim: lid backs that keep near to the ball
CORNERS, FADE = (0.06, 1.12), 0.12  # along an eye from its inner corner: where lids lie on the ball; fading in and out
BESIDE = (0.7, 0.35)  # how much of that holds for the seen lid one and two edges beside the rim
CLOSE = 0.5  # share of the reference's room around the caruncle that is enough
ORBIT = (1.5, 2.8)  # radii of an eye from its centre: bone that goes with it, and bone that stays
AROUND_CARUNCLE = 4.0  # mm: lids and eyeball this near carry it
#: Weight of the lower lid's margin against all of the shut lids: it touches the iris or covers a little of it, but does not
#: hang below, and where it lies is sure to half a millimetre; how thick lids are, to one.
HANGING = 0.3
#: Open lids lie about the iris as the reference's do: weight of the middle between their margins against all of the lids, share
#: of what is left that the eyes look up or down by, and at most, rad. The bone around an eye has not turned as the eye has: it
#: looks 4 degrees too high on two scans whose gaze is known.
BETWEEN, LOOKS, MOST_LOOK = 0.12, 0.8, 0.25
OUTSIDE = 0.8  # mm of lid between eyeball and seen skin, at least, where the reference has as much


def gaze_turn(eyes, warped) -> np.ndarray:
    """The rotation (3, 3) that takes the reference's ``eyes`` to the fitted head's: one, so that both look the same way.

    warped : per eye, callable that carries points (k, 3) of the reference into the fitted head
    """
    total = np.zeros((3, 3))
    for eye, carry in zip(eyes, warped, strict=True):
        axes = np.concatenate([np.eye(3), -np.eye(3)]) * eye.radius + eye.centre
        turn, _ = similarity(axes, carry(axes))
        total += turn / np.cbrt(np.linalg.det(turn))
    left, _, right = np.linalg.svd(total)
    return left @ right


def place_eye(eye: Eye, warped, turn, reference_skin, fitted_skin, lid, inner, margins, scale: float) -> Eye:
    """The eye for a fitted skin.

    Parameters
    ----------
    eye : of the reference, mm
    warped : callable that carries points (k, 3) of the reference into the fitted head
    turn : (3, 3), see `gaze_turn`
    reference_skin, fitted_skin (n, 3) mm
    lid (n,) weights of both lids of this eye; inner (n,) bool: behind the lids
    margins : see `Rest.at_iris`
    scale : size of the fitted head relative to the reference
    """
    radius = float(np.clip(eye.radius * scale ** (0.6 if scale < 1 else 0.4), SMALLEST, LARGEST))
    gaze = turn @ eye.gaze
    gaze = gaze / np.linalg.norm(gaze)
    centre = warped(eye.centre[None])[0]
    gap = np.linalg.norm(reference_skin - eye.centre, axis=1) - eye.radius
    front = (reference_skin - eye.centre) @ eye.gaze > 0
    near = np.flatnonzero((lid > 0.3) & ~inner & (gap < 0.35 * eye.radius) & front)
    if len(near) < 6:
        return _moved(eye, centre, radius, gaze)
    want = gap[near] * radius / eye.radius
    up = _up(eye)
    low = (_middle(reference_skin, margins) - eye.centre) @ up * radius / eye.radius if margins else 0.0
    rim, up = _middle(fitted_skin, margins) if margins else centre, turn @ up
    points, prior = fitted_skin[near], centre.copy()
    for _ in range(30):
        away = points - centre
        length = np.linalg.norm(away, axis=1)
        miss = length - radius - want
        # An eyeball through a lid is seen at once, a gap behind it is not.
        weight = np.where(miss < 0, 4.0, 1.0) / (1 + (miss / 1.5) ** 2)
        unit = away / length[:, None]
        hangs = (rim - centre) @ up - low
        hold = len(near) * (0.0, HANGING * (hangs < 0), BETWEEN)[len(margins)]
        system = (weight[:, None] * unit).T @ unit + 0.05 * len(near) * np.eye(3) + hold * np.outer(up, up)
        right = (weight * miss) @ unit + 0.05 * len(near) * (prior - centre) + hold * hangs * up
        step = np.linalg.solve(system, right)
        centre = centre + step
        if np.linalg.norm(step) < 1e-4:
            break
    return _moved(eye, centre, radius, gaze)


def looking_between_lids(old, new, turn, reference_skin, fitted_skin, margins):
    """(eyes, turn) that look up or down, both alike, toward where the reference's look between their open lids.

    old, new : eyes of the reference and of the fitted head; turn, margins : see `gaze_turn` and, of each, `Rest.at_iris`
    """
    rise = []
    for eye, placed, lids in zip(old, new, margins, strict=True):
        if len(lids) == 2:
            there = (_middle(fitted_skin, lids) - placed.centre) @ turn, _middle(reference_skin, lids) - eye.centre
            fitted, own = (np.arctan2(arm @ _up(eye), arm @ eye.gaze) for arm in there)
            rise.append(fitted - own)
    look = float(np.clip(LOOKS * np.mean(rise), -MOST_LOOK, MOST_LOOK)) if rise else 0.0
    across = np.mean([np.cross(eye.gaze, _up(eye)) for eye in old], axis=0)
    turn = turn @ Rotation.from_rotvec(look * across).as_matrix()
    return [replace(placed, gaze=turn @ eye.gaze) for eye, placed in zip(old, new, strict=True)], turn


def _middle(skin, margins):
    """(3,) mm midway between the ``margins`` of lids, see `Rest.at_iris`."""
    return np.mean([skin[rows].mean(axis=0) for rows in margins], axis=0)


def _up(eye: Eye):
    """(3,) unit vector upward across the gaze."""
    up = np.array([0, 0, 1.0]) - eye.gaze[2] * eye.gaze
    return up / np.linalg.norm(up)


def _moved(eye, centre, radius, gaze):
    grow = radius / eye.radius
    return Eye(centre, radius, gaze, eye.iris_radius * grow, eye.pupil_radius * grow)


def with_orbit(bone, eye: Eye, shift) -> np.ndarray:
    """Bone (n, 3) mm whose orbit went with the ``eye`` when the lids moved that by ``shift`` (3,) mm from its old place."""
    off = np.linalg.norm(bone - (eye.centre - shift), axis=1) / eye.radius
    share = np.clip((ORBIT[1] - off) / (ORBIT[1] - ORBIT[0]), 0, 1)
    return bone + (share * share * (3 - 2 * share))[:, None] * shift


def eye_similarity(old: Eye, new: Eye, turn):
    """Callable that carries the eyeball: the same rigid shape, scaled to the new radius, turned by ``turn`` (3, 3)."""
    return lambda points: (points - old.centre) @ turn.T * (new.radius / old.radius) + new.centre


def eye_part(rest: "Rest", side: str, skin, carried, eye: Eye) -> Work:
    """Work returning the eye part (n, 3) mm: the ball as ``carried`` takes it, the caruncle as ball and lids around it go.

    skin : (n, 3) mm, the fitted head's, with the lids in their places
    """
    part = rest.head.parts[f"eye_{side}"]
    vertices = part.vertices
    flesh, start = vertices[BALL:], rest.head.skin.vertices
    near = cKDTree(flesh)
    lids = np.flatnonzero((rest.lids(side) > 0) & (near.query(start)[0] < AROUND_CARUNCLE))
    ball = np.flatnonzero(near.query(vertices[:BALL])[0] < AROUND_CARUNCLE)
    source = np.concatenate([start[lids], vertices[ball]])
    keep = thinned(source, 0.2)
    space = System(source[keep], 0.0).solve(np.concatenate([skin[lids], carried(vertices[ball])])[keep])
    faces = part.faces[part.faces.min(axis=1) >= BALL] - BALL
    moved = yield from clearing(Mesh(space.transform(flesh), faces), rest.head.skin.moved(skin), eye, CLOSE)
    return np.concatenate([carried(vertices[:BALL]), moved])


def lids_on_eye(rest: "Rest", skin, eye: Eye, side: str) -> np.ndarray:
    """Skin (n, 3) whose lids lie on the eyeball as the reference's do on its own.

    The lids' backs and the inner edge of their margins keep their height over it, fading toward the corners of the
    eye; the outside of the lids keeps at least a lid's thickness.
    """
    head = rest.head
    old = head.eyes["lr".index(side)]
    lid = rest.lids(side) > 0.05
    start = head.skin.vertices
    height = height_over(start, old)
    front = (start - old.centre) @ old.gaze > 0
    rows = np.flatnonzero(lid & front & (height < 0.4 * old.radius))
    if len(rows) == 0:
        return skin
    grow = eye.radius / old.radius
    now = height_over(skin[rows], eye)
    near = (rest.inner | rest.rim).astype(float)
    for share in BESIDE:
        near = np.maximum(near, share * (rest.link @ near > 0.99 * near[near > 0].min()))
    keep = near[rows] * _between_corners(head, start[rows], side)
    least = (
        np.where(
            rest.inner[rows],
            np.minimum(height[rows], 0.1),
            np.clip(0.6 * height[rows], np.minimum(height[rows], 0.05), OUTSIDE),
        )
        * grow
    )
    want = np.maximum(now + keep * (grow * height[rows] - now), least)
    out = np.array(skin)
    away = out[rows] - eye.centre
    length = np.linalg.norm(away, axis=1)
    out[rows] = eye.centre + away * ((length + want - now) / np.maximum(length, 1e-9))[:, None]
    return out


def lid_contact(rest: "Rest", side: str) -> LidContact:
    """The lids of the reference's eye ``side`` as `LidContact` moves them."""
    head = rest.head
    lid = rest.lids(side) > 0.05
    stiff = np.full(len(lid), np.inf)
    reached = np.zeros(len(lid), dtype=bool)
    reached[rest.organs[f"eye_{side}"]] = True
    reached |= rest.rim & lid
    stiff[reached] = BACK
    for hardness in SEEN:
        grown = (reached | (rest.link @ reached.astype(float) > 0)) & (lid | reached)
        stiff[grown & ~reached] = hardness
        reached = grown
    share = _along(head, head.skin.vertices, side)
    edge = np.flatnonzero(rest.rim & (rest.lids(side) > 0.3) & (share > EDGES[0]) & (share < EDGES[1]))
    back = np.flatnonzero(rest.inner & (rest.behind <= BACKS) & lid)
    contact = LidContact(head.skin.faces, head.skin.triangles, len(lid), stiff, edge, back)
    contact.allow(head.skin.vertices, head.eyes["lr".index(side)])
    return contact


def settled_lids(rest: "Rest", skin, eye: Eye, side: str) -> np.ndarray:
    """Skin (n, 3) mm whose lids touch the eyeball nowhere and lie on it between the corners of the eye."""
    contact, head = rest.contacts[side], rest.head
    own = rest.head.landmarks.on({"skin": skin})
    now, before = (_along(head, x[contact.edge], side, marks) for x, marks in ((skin, own), (head.skin.vertices, None)))
    within = [np.clip(np.minimum(share - LIES[0], LIES[1] - share) / BEGINS, 0, 1) for share in (now, before)]
    return contact.settled(skin, eye, np.where(within[1] > 0, 0, within[0]))


def _along(head: Head, points, side: str, marks=None):
    """(k,) from 0 at the inner corner of the eye to 1 at the outer one; ``marks``: other landmarks than the head's."""
    marks = head.landmark_positions() if marks is None else marks
    inner, outer = marks[f"en_{side}"], marks[f"ex_{side}"]
    return (points - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))


def _between_corners(head: Head, points, side: str):
    """(k,) 1 between the corners of the eye, where lids lie on the ball, 0 at them."""
    share = _along(head, points, side)
    ends = np.minimum((share - CORNERS[0]) / FADE, (CORNERS[1] - share) / FADE)
    return np.clip(ends, 0, 1)
