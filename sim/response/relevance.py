# SPDX-License-Identifier: GPL-3.0-or-later
"""How much each input counts in the likeness of two poses, learnt from the samples themselves.

Automatic relevance determination (Rasmussen and Williams 2006, 5.1) by the error with which the regression tells every
sample from all others, which needs one inverse and no second fit (5.4.2, equations 5.10 to 5.13; Sundararajan and
Keerthi 2001). In millimetres, not in likelihood: it is millimetres that are seen.
"""

import numpy as np
from scipy.optimize import minimize

from .kernel import LINEAR, SQUARE, likeness, matern, matern_slope, noise

#: Samples that are looked at, steps, and modes of the motion: more told hardly better.
COUNT, _STEPS, _MODES = 600, 40, 20
#: Fewer samples tell nothing.
_ENOUGH = 100
#: A pose of one channel at its end lies apart from all others, and is never asked for as a guess.
_SINGLE = 0.25
#: For how many samples it counts that the log relevances of all inputs stray by 1 rms from what the head itself suggests.
#: They are bounded besides.
_PRIOR, _BOUND = 85.0, 5.0


def chosen(count: int, singles: int) -> np.ndarray:
    """Which of ``count`` samples are looked at: the single poses and mixtures at random."""
    rng = np.random.default_rng(0)
    return np.concatenate([np.arange(singles), singles + rng.permutation(count - singles)[:COUNT]])


def relevance(bending: np.ndarray, forces: np.ndarray, motion: np.ndarray, scale: np.ndarray, singles: int):
    """The scale (p,) of a region's inputs that tells its samples best from each other, and mm rms by which it still fails.

    bending, forces : (s, p) as `rig.coordinates` has them; motion : (s, 3 v) mm; scale : (p,) to begin with, where it is 0
    it stays so; singles : how many of the samples, the first ones, are single poses. Where there are too few samples to tell,
    ``scale`` as it is, and 0.
    """
    if len(motion) < _ENOUGH:
        return scale, 0.0
    on = np.flatnonzero(scale > 0)
    weight = np.ones(len(motion))
    weight[:singles] = _SINGLE
    modes = motion @ np.linalg.eigh(motion.T @ motion)[1][:, -_MODES:]
    base = scale[on] ** 2
    stiff = 2 * _PRIOR / (len(motion) * max(len(on), 1))

    def error(logs):
        value, slope = _left_out(base * np.exp(logs), bending[:, on], forces[:, on], modes, weight)
        return np.log(value) + stiff * logs @ logs / 2, slope * base * np.exp(logs) / value + stiff * logs

    bounds = [(-_BOUND, _BOUND)] * len(on)
    logs = minimize(error, np.zeros(len(on)), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS}).x
    out = np.zeros_like(scale)
    out[on] = np.sqrt(base * np.exp(logs))
    value, _ = _left_out(out[on] ** 2, bending[:, on], forces[:, on], modes, weight)
    return out, float(np.sqrt(value * 3 / motion.shape[1]))


def _left_out(relevances, bending, forces, modes, weight):
    """Mean squared error of each sample told from all others, over the modes, and its slope by the ``relevances`` (p,)."""
    kernel, far, size, product = likeness(bending, forces, relevances)
    kernel[np.diag_indices_from(kernel)] += noise(kernel)
    inverse = np.linalg.inv(kernel)
    apart = np.diag(inverse)
    alpha = inverse @ modes
    off = alpha / apart[:, None]
    squared = (off**2).sum(axis=1)
    total = weight.sum()
    # The slope by the kernel: of alpha, and of the inverse's diagonal.
    by_kernel = -(inverse @ (2 * weight[:, None] * off / apart[:, None])) @ alpha.T
    by_kernel += (inverse * (2 * weight * squared / apart)) @ inverse
    by_kernel = (by_kernel + by_kernel.T) / (2 * total)
    by_far = by_kernel * matern_slope(far)
    slope = 2 * (by_far.sum(axis=1) @ bending**2 - np.einsum("ip,ip->p", bending, by_far @ bending))
    slope -= 2 * ((by_kernel @ matern(size)) * matern_slope(size)) @ bending**2
    slope += np.einsum("ip,ip->p", forces, (by_kernel * (LINEAR + 2 * SQUARE * product)) @ forces)
    return (weight @ squared) / total, slope
