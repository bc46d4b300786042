# SPDX-License-Identifier: GPL-3.0-or-later
"""A plausible head laid on a scan without landmarks: closest points that face the same way, the most likely shape.

Each round pairs the skin with the scan and solves for place and shape together: the coefficients of the shape space
that are most likely given the data (least squares with the space's own variance as regulariser), where distances along
the scan's normals count and outliers are given up (Geman and McClure 1987).
"""

from dataclasses import dataclass, field

import numpy as np

from ..adapt.closest import Surface
from ..mesh import vertex_normals
from .pose_search import Pose
from .shape_space import ShapeSpace

#: One round each: share of the modes' variance allowed, reach in mm, width in mm of an outlier, noise in mm.
SCHEDULE = (
    *((0.05, 30.0, 14.0, 6.0),) * 4,
    *((0.3, 24.0, 10.0, 4.0),) * 4,
    *((1.0, 18.0, 7.0, 3.0),) * 5,
    *((1.0, 14.0, 5.0, 2.0),) * 5,
    *((1.0, 10.0, 3.5, 1.4),) * 5,
    *((1.0, 8.0, 2.5, 1.0),) * 5,
)
#: From one expression to another.
CHANGE = SCHEDULE[-8:]
#: The first rounds tell a face from what only looks like one.
TRIAL = SCHEDULE[:9]
ALONG = 0.3  # weight of a pull along the surface against one across it
BEND = 5.0  # how much better a place is that faces the same way, see `Surface.ranked`
AGREE = 0.45  # cosine between the normals of skin and scan
LEAST = 60  # points of the skin that must find the scan
#: Weight of skin on which hair grows. Hair stands off it by centimetres, too many of them to be outliers, and would take the
#: ears with it; a bald head is told as well by so little.
HAIR = 0.05
#: mm off such skin from which on it is hair; depth of hair and its standard deviation, mm.
BALD, DEEP = 6.0, (10.0, 10.0)
STANDS_OFF = 35.0  # mm: so far hair may
#: The same of hair that is known to be. It is as deep all over a head: much of it tells no more of that than little.
SEEN_DEEP = (13.0, 18.0)
PATCH = 40.0  # mm²: so much of the surface says one thing
TOLD = 1.0  # mm by which a place that is told may be wrong
EAR_SEEN = 0.2  # share of an ear that finds the scan: from there on that tells where the ear is
TILT = 0.05  # rad of turn, and fraction of size, that count as much as 1 standard deviation


class NoFaceError(Exception):
    """Too little of the skin finds anything on the scan."""


@dataclass(frozen=True)
class Expression:
    """What lips and lids do: whether the lips are ``parted``, the sides ("l", "r") of eyes that are ``shut``, and whether
    eyes are ``wide`` open, as the reference's. ``lids`` : name -> (3,) mm, ``ps`` and ``pi`` of eyes that are seen open, and
    ``en`` and ``ex`` of empty sockets."""

    parted: bool = False
    shut: tuple[str, ...] = ()
    wide: bool = False
    lids: dict[str, np.ndarray] = field(default_factory=dict)


REST = Expression()


@dataclass(frozen=True, eq=False)
class Told:
    """Places (k, 3) mm on the scan of points of the skin: corners (k, 3), weights (k, 3) : where those ride on its points."""

    corners: np.ndarray
    weights: np.ndarray
    places: np.ndarray

    @classmethod
    def of(cls, space: ShapeSpace, landmarks: dict[str, np.ndarray]) -> "Told":
        """What ``landmarks``, name -> (3,) mm on the scan, tell of the ``space``."""
        rows = [space.names.index(name) for name in landmarks]
        return cls(space.corners[rows], space.weights[rows], np.reshape(list(landmarks.values()), (-1, 3)))

    def and_of(self, other: "Told | None") -> "Told":
        """Both together."""
        if other is None:
            return self
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("corners", "weights", "places"))
        return Told(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """A skin laid on the scan.

    points (n, 3) mm in the scan's place; coefficients (m,); pose : the similarity from the reference's place;
    trust (n,) 0..1 : how far data decided; distance (n,) mm to the scan along its normal, NaN where there is none
    spread (m, r) : a root of the coefficients' covariance given the data, for `doubt`
    """

    points: np.ndarray
    coefficients: np.ndarray
    pose: Pose
    trust: np.ndarray
    distance: np.ndarray
    spread: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) linear part of the similarity."""
        return self.pose.scale * self.pose.turn


def fit_shape(
    space: ShapeSpace,
    target: Surface,
    pose: Pose,
    rounds=SCHEDULE,
    coefficients=None,
    every=1,
    expression=REST,
    told: Told | None = None,
    hair=None,
    size: float | None = None,
):
    """A generator: yields the fraction done, returns the `ShapeFit` that begins at ``pose``.

    coefficients (k,) : to begin with, of the first k modes; every : look at each so many-th point of the skin only;
    expression : what lips and lids are taken to do; told : what is known besides (None: nothing); hair (n,) bool : points
    that are known to lie under hair; where it is known that none does, the scalp counts as any skin
    size : standard deviation of the head's size, as its logarithm, about the likeliest (None: nothing is known of it)

    Raises
    ------
    NoFaceError : next to nothing of the scan lies where the face is looked for.
    """
    m = space.modes.shape[2]
    coefficients = np.zeros(m) if coefficients is None else np.r_[coefficients, np.zeros(m - len(coefficients))]
    scale, turn, shift = pose.scale, pose.turn, pose.shift
    middle = space.points[space.face > 0.5].mean(axis=0)
    usual = sum((space.shut[side] for side in expression.shut), np.zeros(m))
    usual += expression.parted * space.parted
    looking = np.arange(len(space.points))[::every]
    hairy = space.hairy if hair is None or hair.any() else np.zeros_like(space.hairy)
    hairy = hairy if hair is None else hairy | hair
    area = space.area / PATCH * np.where(hairy, HAIR, 1.0)
    bare = looking if hair is None else looking[~hair[looking]]
    ears = {side: bare[(space.ear[bare] > 0.5) & space.on_side(side)[bare]] for side in "lr"}
    for done, (variance, reach, width, noise) in enumerate(rounds):
        shaped = space.shaped(coefficients)
        points = scale * shaped @ turn.T + shift
        found, trust, normals = pairs(space, points, target, reach * scale, looking[~hairy[looking]])
        above = pairs(space, points, target, max(reach, STANDS_OFF) * scale, looking[hairy[looking]])
        for whole, part in zip((found, trust, normals), above, strict=True):
            whole[hairy] = part[hairy]
        use = np.flatnonzero(trust > 0)
        if len(use) * every < LEAST:
            raise NoFaceError
        place = ((found[use] - shift) @ turn) / scale
        across = normals[use] @ turn
        gap = place - shaped[use]
        height = np.einsum("ij,ij->i", gap, across)
        weight = every * trust[use] * area[use] / (1 + (height / width) ** 2) ** 2 / noise**2
        # What stands off hairy skin is hair of some depth, whatever the round.
        seen = np.zeros(len(use), dtype=bool) if hair is None else hair[use]
        for some, (depth, deviation) in ((hairy[use] & ~seen & (height > BALD), DEEP), (seen, SEEN_DEEP)):
            weight[some] = every * (trust * area)[use][some] / deviation**2
            gap[some] -= depth * across[some]
        # Unknowns: a small turn about the face, a shift, a change of size, and the coefficients.
        rows = np.concatenate([_rigid(shaped[use] - middle), space.modes[use]], axis=2)
        right = gap + space.modes[use] @ coefficients
        one = (across[:, None, :] @ rows)[:, 0]
        few = slice(None, None, 4)  # the pull along the surface only steadies what the normals leave open
        flat = rows[few].reshape(-1, 7 + m)
        wide = np.repeat(4 * ALONG**2 * weight[few], 3)
        heavy = one * weight[:, None]
        system = heavy.T @ one + (flat * wide[:, None]).T @ flat
        pull = heavy.T @ np.einsum("ki,ki->k", across, right) + flat.T @ (wide * right[few].ravel())
        if told is not None:
            own = np.einsum("kij,ki->kj", shaped[told.corners], told.weights)
            modes = np.einsum("kijm,ki->kjm", space.modes[told.corners], told.weights)
            rows = np.concatenate([_rigid(own - middle), modes], axis=2).reshape(-1, 7 + m) / TOLD
            off = ((told.places - shift) @ turn) / scale - own + modes @ coefficients
            system += rows.T @ rows
            pull += rows.T @ (off.ravel() / TOLD)
        prior = np.full(7 + m, 1 / variance)
        prior[[0, 1, 2, 6]] = 1e-3 / TILT**2
        prior[3:6] = 1e-6
        if size is not None:
            prior[6] = 1 / size**2
            pull[6] -= prior[6] * np.log(scale / space.size)
        system[np.diag_indices_from(system)] += prior
        pull[7:] += prior[7:] * usual
        for side, (form, way) in space.beside.items():
            seen = (trust[ears[side]] > 0).sum() / max(len(ears[side]), 1)
            unseen = max(1 - seen / EAR_SEEN, 0)
            system[7:, 7:] += unseen * form
            pull[7:] += unseen * way
        if not expression.parted:
            system[7:, 7:] += space.seal
        for side, form in space.lids.items():
            if expression.wide or side in expression.shut:
                system[7:, 7:] += form
                pull[7:] += form @ space.shut[side] * (side in expression.shut)
        step = np.linalg.solve(system, pull)
        coefficients = step[7:]
        grow = 1 + np.clip(step[6], -0.1, 0.1)
        small = _rotation(np.clip(step[:3], -0.3, 0.3))
        # x -> middle + grow small (x - middle) + move, then the similarity so far
        shift = shift + scale * turn @ (middle + step[3:6] - grow * small @ middle)
        turn, scale = turn @ small, scale * grow
        yield (done + 1) / len(rounds)
    spread = np.linalg.cholesky(np.linalg.inv(system))[7:]
    points = scale * space.shaped(coefficients) @ turn.T + shift
    found, trust, normals = pairs(space, points, target, 4.0 * scale)
    gap = np.einsum("ij,ij->i", points - found, normals)
    distance = np.where(trust > 0, gap, np.nan)
    return ShapeFit(points, coefficients, Pose(scale, turn, shift, pose.misfit), trust, distance, spread)


def part_of(work, before: int, of: int):
    """A generator: what ``work``, which yields the fraction done, is of a whole, of whose parts ``before`` ``of`` are done."""
    while True:
        try:
            done = next(work)
        except StopIteration as end:
            return end.value
        yield (before + done) / of


def pairs(space: ShapeSpace, points, target: Surface, reach, looking=slice(None)):
    """Where on the scan the skin's ``points`` belong: place (n, 3), trust (n,) 0..1, the scan's normals there (n, 3).

    Points that are not ``looking`` get no trust.
    """
    normals = vertex_normals(points, space.triangles)
    found = target.ranked(points[looking], normals[looking], reach, AGREE, bend=BEND)
    agree = np.einsum("ij,ij->i", found.normals, normals[looking])
    trust, place, across = np.zeros(len(points)), np.full_like(points, np.nan), np.zeros_like(points)
    trust[looking] = np.where(found.found & ~found.border, np.clip((agree - AGREE) / (1 - AGREE) * 1.5, 0.05, 1), 0)
    place[looking], across[looking] = found.points, found.normals
    return place, trust, across


def _rigid(arm):
    """(k, 3, 7): how points at ``arm`` (k, 3) from the middle answer to a small turn, a shift and growth."""
    out = np.zeros((len(arm), 3, 7))
    out[:, 0, 1], out[:, 0, 2] = arm[:, 2], -arm[:, 1]
    out[:, 1, 0], out[:, 1, 2] = -arm[:, 2], arm[:, 0]
    out[:, 2, 0], out[:, 2, 1] = arm[:, 1], -arm[:, 0]
    out[:, :, 3:6] = np.eye(3)
    out[:, :, 6] = arm
    return out


def _rotation(vector):
    """Rotation (3, 3) by a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    k = np.array([[0, -vector[2], vector[1]], [vector[2], 0, -vector[0]], [-vector[1], vector[0], 0]])
    if angle < 1e-12:
        return np.eye(3) + k
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k
