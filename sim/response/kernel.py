# SPDX-License-Identifier: GPL-3.0-or-later
"""How alike two poses are: Matérn 3/2 in what skin bends with, linear and a little quadratic in the forces.

Rasmussen and Williams 2006, 4.17 and 4.2.2. Contact makes the response no smoother than the first; the last tells of many
muscles at once, where samples are far between.
"""

import numpy as np

#: Of the Matérn kernel, in the scaled coordinates of a region.
LENGTH = 2.5
#: Weights of the linear and of the quadratic kernel, beside the Matérn's 1.
LINEAR, SQUARE = 3.0, 0.03
#: Noise of a sample: a share of its own variance, the less it moves the less it may be off, and a share of that of all.
_NOISE, _NOISE_OF_ALL = 3e-5, 3e-7


def matern(squared: np.ndarray) -> np.ndarray:
    """Matérn 3/2 of squared distances (any shape), 1 at 0."""
    far = np.maximum(squared, 0.0)
    far *= squared.dtype.type(3 / LENGTH**2)
    np.sqrt(far, out=far)
    near = np.exp(-far)
    far += 1
    near *= far
    return near


def matern_slope(squared: np.ndarray) -> np.ndarray:
    """Its slope by the squared distances."""
    return np.exp(-np.sqrt(np.maximum(squared, 0.0) * (3 / LENGTH**2))) * (-1.5 / LENGTH**2)


def noise(kernel: np.ndarray) -> np.ndarray:
    """(s,) the noise of samples whose kernel (s, s) is this."""
    own = np.diag(kernel)
    return _NOISE * own + _NOISE_OF_ALL * own.mean()


def likeness(bending: np.ndarray, forces: np.ndarray, relevances: np.ndarray):
    """Kernel (s, s) of samples that bent with (s, p) and pulled with (s, p), less what they have with rest, each input
    counting by its ``relevances`` (p,); and what it is made of: squared distances (s, s), of each from rest (s,), products
    of the forces (s, s)."""
    bend = bending * relevances
    size = (bend * bending).sum(axis=1)
    far = size[:, None] + size - 2 * bend @ bending.T
    product, rest = (forces * relevances) @ forces.T, matern(size)
    kernel = matern(far) - rest[:, None] * rest + LINEAR * product + SQUARE * product**2
    return kernel, far, size, product
