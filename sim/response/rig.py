# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig: the skin of a head in any pose in about a millisecond, learnt from the simulation.

Inputs become forces and progress of the muscles (`spending`). The skin's own motion (`jaw_frame`) is linear in the
forces plus a function of how it bends: kernel ridge regression (Rasmussen and Williams 2006, 2.25; the kernel: `kernel`),
region by region, each seeing only what moves it (`relevance`), in principal modes of what it does. At rest all terms
vanish: the neutral face is exactly the scan.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..blas import one_thread
from ..tissue.jaw import left_ahead, left_aside
from ..tissue.structures import Control
from .inputs import CENTRES, OTHERS, inputs_of
from .jaw_frame import JawFrame
from .kernel import SQUARE, matern
from .spending import Spending

#: What skin bends with, of a muscle: its progress, and this share of its activation in place of as much of that.
_ASKED = 0.4
_OPEN, _AHEAD, _ASIDE = (OTHERS.index(name) for name in ("jaw_open", "jaw_forward", "jaw_side"))


@dataclass(frozen=True, eq=False)
class Region:
    """Skin that is moved by the same: vertices (v,), and what its m modes are by kernel and force.

    weights (c + p, m) over the kernels of the first c samples and over the forces; modes (m, 3 v) mm
    """

    vertices: np.ndarray
    weights: np.ndarray
    modes: np.ndarray


@dataclass(frozen=True, eq=False)
class Rig:
    """muscle_names of the head; sphincters: which of the k muscles that pull on skin are the lips' (-1: none); g regions,
    those that look at most samples first.

    scale (g, p) weights of what skin bends with, 0 where a region does not feel an input; samples, pulls (s, p) what it bent
    with in the poses it was learnt from, and the forces in them
    """

    muscle_names: tuple[str, ...]
    spending: Spending
    frame: JawFrame
    sphincters: tuple[int, int]
    scale: np.ndarray
    samples: np.ndarray
    pulls: np.ndarray
    regions: tuple[Region, ...]

    @cached_property
    def _groups(self) -> tuple["_Group", ...]:
        """The regions in groups that look at the same samples."""
        counts = np.array([len(region.weights) for region in self.regions]) - self.samples.shape[1]
        first = np.flatnonzero(np.diff(counts, prepend=-1))
        out = []
        for a, b in zip(first, [*first[1:], len(counts)], strict=True):
            felt = np.flatnonzero(self.scale[a:b].any(axis=0))
            seen = (np.ascontiguousarray(x[: counts[a], felt].T) for x in (self.samples, self.pulls))
            out.append(_Group(felt, self.scale[a:b, felt] ** 2, *seen))
        return tuple(out)

    @cached_property
    def _vertices(self) -> np.ndarray:
        """(total v,) the regions' vertices."""
        return np.concatenate([region.vertices for region in self.regions])

    def skin(self, control: Control) -> np.ndarray:
        """(n, 3) mm, the skin in a pose."""
        return self.frame.placed(self.own(self.inputs(control)[None])[0], control.jaw)

    def inputs(self, control: Control) -> np.ndarray:
        """(p,) the inputs of a control."""
        return inputs_of(self.muscle_names, control)

    def own(self, inputs: np.ndarray) -> np.ndarray:
        """(f, n, 3) mm: the skin's own motion for f rows of inputs (f, p)."""
        forces, bending = (x.astype(np.float32) for x in coordinates(self.spending, self.sphincters, inputs))
        with one_thread():
            likeness = (row for group in self._groups for row in group.kernels(forces, bending))
            moved = [row @ region.weights @ region.modes for row, region in zip(likeness, self.regions, strict=True)]
        out = np.zeros((len(inputs), len(self.frame.rest), 3), np.float32)
        out[:, self._vertices] = np.concatenate(moved, axis=1).reshape(len(inputs), -1, 3)
        return out


@dataclass(frozen=True, eq=False)
class _Group:
    """g regions that look at the same c samples: felt (q,) the inputs that any of them feels; weight (g, q) of each squared
    difference in the squared distance of two poses, and of each product in their product; samples, pulls (q, c) as `Rig`
    has them."""

    felt: np.ndarray
    weight: np.ndarray
    samples: np.ndarray
    pulls: np.ndarray

    @cached_property
    def _rest(self) -> tuple[np.ndarray, np.ndarray]:
        """(g, 1, c) the squared distance of each sample from rest, and its kernel with rest."""
        far = (self.weight @ self.samples**2)[:, None]
        return far, matern(far)

    def kernels(self, forces: np.ndarray, bending: np.ndarray) -> np.ndarray:
        """(g, f, c + p) kernel of every pose with every sample as each region sees them, less what either has with rest;
        then the forces (f, p)."""
        far, rest = self._rest
        count = self.samples.shape[1]
        out = np.empty((len(self.weight), len(forces), count + forces.shape[1]), np.float32)
        out[..., count:] = forces
        forces, bending = forces[:, self.felt], bending[:, self.felt]
        size = (self.weight @ (bending**2).T)[..., None]
        squared = self._products(-2 * bending, self.samples)
        squared += far
        squared += size
        kernel = out[..., :count]
        kernel[:] = matern(squared)
        kernel -= matern(size) * rest
        product = self._products(np.float32(SQUARE**0.5) * forces, self.pulls)
        product *= product
        kernel += product
        return out

    def _products(self, poses, samples):
        """(g, f, c) of poses (f, q) with samples (q, c), by each region's weight; one product of matrices for all."""
        both = (self.weight[:, None] * poses).reshape(-1, len(self.felt)) @ samples
        return both.reshape(len(self.weight), len(poses), -1)


def coordinates(spending: Spending, sphincters, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the skin is linear in (f, p), forces, and what it bends with (f, p), between the progress of the muscles and what
    is asked of them; each followed by the other inputs, of the jaw's motions what its opening leaves of them.
    Forces count 1 for a muscle alone at its end. A muscle that has no entries in the tissue (of a lid) stays."""
    k = len(spending.mutual)
    activation, others = inputs[:, :k], inputs[:, k:].copy()
    forces, progress = spending.forces(activation, others)
    for at, muscle in zip(CENTRES, sphincters, strict=True):
        if muscle < 0:
            continue
        left = forces[:, muscle] / np.maximum(activation[:, muscle], 1e-6)
        others[:, at] *= np.where(activation[:, muscle] > 1e-6, left, 1.0)
    opening = others[:, _OPEN]
    others[:, _AHEAD] *= left_ahead(opening)
    others[:, _ASIDE] *= left_aside(opening)
    own = np.diag(spending.mutual)
    without = ~spending.mutual.any(axis=1)
    progress = np.where(without, activation, progress)
    bending = progress + _ASKED * (activation - progress)
    return np.concatenate([forces * (1 + own), others], axis=1), np.concatenate([bending, others], axis=1)
