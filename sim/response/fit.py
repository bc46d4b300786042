# SPDX-License-Identifier: GPL-3.0-or-later
"""From samples to a `Rig`: who moves what, regions of skin that are moved by the same, and a regression for each."""

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.linalg import solve

from ..progress import Progress, Work
from ..tissue.muscle_field import LIPS
from ..tissue.structures import Model
from .inputs import OTHERS
from .jaw_frame import JawFrame
from .kernel import LINEAR, likeness, noise
from .mirror import Seen, seen_twice
from .relevance import chosen, relevance
from .rig import Region, Rig, coordinates
from .sampling import Samples
from .spending import fit_spending

REGIONS = 20
#: mm that a vertex must move in some sample to be in a region at all; mm rms that the modes may lose, at least and at most,
#: and between these which share of what the region is off by anyway.
_STILL, _LOST, _LOST_SHARE = 0.01, (0.01, 0.1), 0.15
#: A region feels an input that moves it by this share of what its strongest one does.
_FELT = 0.002
#: Of that share, for its weight: between ignoring the weak and taking all alike. What changes how lips touch weighs more
#: than by how far it moves skin: the jaw, the lips' centres and their seal.
_POWER = 0.75
_MORE = {"jaw_open": 2.0, "jaw_forward": 2.0, "jaw_side": 2.0, "seal": 2.5, "cheeks": 0.8}
_MORE |= {"lip_upper_forward": 1.7, "lip_lower_forward": 1.7}
#: A region where samples tell each other as well as this, mm rms, looks at so many of them; if not quite so well, at all
#: that were simulated; and at their mirror images besides where that is hard, as it is about the lips. With fewer samples
#: than so many there is room for images everywhere.
_EASY, _FEW, _HARD = 0.12, 700, 0.3


def fit_rig(model: Model, samples: Samples, singles: int, opposite: np.ndarray | None = None) -> Work:
    """The `Rig` of a head from ``samples``, of which the first ``singles`` are single poses (`sampling.single_poses`).

    opposite : `mirror.opposite_vertices` of the head
    """
    yield Progress(0.0, "Fitting muscles")
    k = len(samples.muscles)
    activation, others = samples.inputs[:, :k], samples.inputs[:, k:]
    spending = fit_spending(activation, others, samples.progress, samples.left)
    sphincters = tuple(samples.muscles.index(name) if name in samples.muscles else -1 for name in LIPS)
    frame = JawFrame(model.layers.nodes[: model.count], model.layers.jaw, model.jaw)
    yield Progress(0.1, "Fitting the jaw")
    own = np.stack([frame.own(skin, jaw) for skin, jaw in zip(samples.skin.astype(float), samples.jaw, strict=True)])
    felt = sensitivity(samples.inputs[:singles], own[:singles])
    moving = np.flatnonzero(np.abs(own).max(axis=(0, 2)) > _STILL)
    region = _regions(felt[:, moving], frame.rest[moving])
    members = [moving[region == r] for r in np.unique(region)]
    seen = seen_twice(model.muscle_names, samples.inputs, own, opposite)
    forces, bending = coordinates(spending, sphincters, seen.inputs)
    some = chosen(len(own), singles)
    found = []
    for number, vertices in enumerate(members):
        yield Progress(0.2 + 0.8 * number / len(members), f"Fitting region {number + 1} of {len(members)}")
        motion = own[some][:, vertices].reshape(len(some), -1)
        scale, off = relevance(bending[some], forces[some], motion, _scale(felt[:, vertices]), singles)
        found.append((scale, _fit_region(vertices, bending, forces, seen, scale, off)))
    found.sort(key=lambda each: -len(each[1].weights))
    scale, regions = zip(*found, strict=True)
    packed = (np.array(x, np.float32) for x in (scale, bending, forces))
    return Rig(model.muscle_names, spending, frame, sphincters, *packed, tuple(regions))


def sensitivity(inputs: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(p, n) mm by which each vertex answers each input: the least of what the poses that use it show, (s, p), (s, n, 3)."""
    moved = np.linalg.norm(own, axis=2)
    out = np.full((inputs.shape[1], own.shape[1]), np.inf)
    for row, motion in zip(np.abs(inputs), moved, strict=True):
        for at in np.flatnonzero(row > 0.05):
            out[at] = np.minimum(out[at], motion / row[at])
    return np.where(np.isfinite(out), out, 0.0)


def _regions(felt, rest):
    """(v,) number of each vertex's region: alike in what moves them, and near each other."""
    seen = np.log1p(felt.T / 0.2)
    seen = np.concatenate([seen / max(np.sqrt((seen**2).mean()), 1e-9), rest / 40], axis=1)
    count = min(REGIONS, len(rest))
    return kmeans2(seen, count, seed=3, minit="++")[1]


def _scale(felt: np.ndarray) -> np.ndarray:
    """(p,) weight of each input in the distance between two poses, from how a region feels them (p, v)."""
    strength = np.sqrt((felt**2).mean(axis=1))
    strength = strength / max(strength.max(), 1e-9)
    more = np.ones(len(felt))
    more[len(felt) - len(OTHERS) :] = [_MORE.get(name, 1.0) for name in OTHERS]
    return np.where(strength > _FELT, strength, 0.0) ** _POWER * more


def _fit_region(vertices, bending, forces, seen: Seen, scale, off: float) -> Region:
    """The regression of one region: what skin bends with, forces (s, p), the motion of its vertices, and mm by which its
    samples fail to tell each other.

    Mirror images are another face's poses: their covariance with the head's own is less by the correlation of both faces
    (intrinsic coregionalisation: Bonilla, Chai and Williams 2008).
    """
    count = len(bending) if off > _HARD else max(seen.real.sum(), _FEW) if off > _EASY else _FEW
    bending, forces, real = bending[:count], forces[:count], seen.real[:count]
    motion = seen.own[:count, vertices].reshape(len(bending), -1)
    values, axes = np.linalg.eigh(motion.T @ motion)  # least first
    lost = np.sqrt(3 * np.cumsum(values.clip(0)) / motion.size)
    axes = axes[:, min(np.searchsorted(lost, np.clip(_LOST_SHARE * off, *_LOST)), len(lost) - 1) :]
    kernel, *_ = likeness(bending, forces, scale**2)
    alike = seen.alike(vertices)
    kernel[np.ix_(real, ~real)] *= alike
    kernel[np.ix_(~real, real)] *= alike
    kernel[np.diag_indices_from(kernel)] += noise(kernel)
    weights = solve(kernel, motion @ axes, assume_a="pos")
    weights[~real] *= alike
    weights = np.concatenate([weights, LINEAR * scale[:, None] ** 2 * (forces.T @ weights)])
    # Column by column: a single pose multiplies these with a vector, and so they are read in one go.
    return Region(vertices, np.asfortranarray(weights, np.float32), np.ascontiguousarray(axes.T, np.float32))
