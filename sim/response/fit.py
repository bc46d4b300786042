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
from .mirror import Seen, seen_twice
from .rig import SQUARE, Region, Rig, coordinates, matern
from .sampling import Samples
from .spending import fit_spending

REGIONS = 20
#: mm that a vertex must move in some sample to be in a region at all; mm rms that the modes may lose.
_STILL, _LOST = 0.01, 0.03
#: A region feels an input that moves it by this share of what its strongest one does.
_FELT = 0.002
#: Of that share, for its weight: between ignoring the weak and taking all alike. What changes how lips touch weighs more
#: than by how far it moves skin: the jaw, the lips' centres and their seal.
_POWER = 0.75
_MORE = {"jaw_open": 2.0, "jaw_forward": 2.0, "jaw_side": 2.0, "seal": 2.5, "cheeks": 0.8}
_MORE |= {"lip_upper_forward": 1.7, "lip_lower_forward": 1.7}
#: Weight of the linear part beside the Matérn kernel. Noise of a sample: a share of its own variance, the less it moves the
#: less it may be off, and a share of that of all.
_LINEAR, _NOISE, _NOISE_OF_ALL = 3.0, 3e-5, 3e-7


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
    scale, regions = [], []
    for number, vertices in enumerate(members):
        yield Progress(0.2 + 0.8 * number / len(members), f"Fitting region {number + 1} of {len(members)}")
        scale.append(_scale(felt[:, vertices]))
        regions.append(_fit_region(vertices, bending, forces, seen, scale[-1]))
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


def _fit_region(vertices, bending, forces, seen: Seen, scale) -> Region:
    """The regression of one region: what skin bends with, forces (s, p), and the motion of its vertices.

    Mirror images are another face's poses: their covariance with the head's own is less by the correlation of both faces
    (intrinsic coregionalisation: Bonilla, Chai and Williams 2008).
    """
    at, line = bending * scale, forces * scale
    motion = seen.own[:, vertices].reshape(len(at), -1)
    values, axes = np.linalg.eigh(motion.T @ motion)  # least first
    lost = np.sqrt(3 * np.cumsum(values.clip(0)) / motion.size)
    axes = axes[:, min(np.searchsorted(lost, _LOST), len(lost) - 1) :]
    size = (at**2).sum(axis=1)
    kernel = matern(size[:, None] + size - 2 * at @ at.T)
    rest = matern(size)
    product = line @ line.T
    kernel += _LINEAR * product + SQUARE * product**2 - rest[:, None] * rest
    alike = seen.alike(vertices)
    kernel[np.ix_(seen.real, ~seen.real)] *= alike
    kernel[np.ix_(~seen.real, seen.real)] *= alike
    own = np.diag(kernel)
    kernel[np.diag_indices_from(kernel)] += _NOISE * own + _NOISE_OF_ALL * own.mean()
    weights = solve(kernel, motion @ axes, assume_a="pos")
    weights[~seen.real] *= alike
    linear = _LINEAR * scale[:, None] * (line.T @ weights)
    return Region(vertices, *(x.astype(np.float32) for x in (weights, linear, np.ascontiguousarray(axes.T))))
