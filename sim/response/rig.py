# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig: the skin of a head in any pose in about a millisecond, learnt from the simulation.

Inputs become forces and progress of the muscles (`spending`). The skin's own motion (`jaw_frame`) is linear in the
forces plus a function of how it bends: kernel ridge regression with a Matérn 3/2 kernel (Rasmussen and Williams 2006,
4.17 and 2.25; contact makes the response no smoother than that) and a little of a quadratic one in the forces, which tells
of many muscles at once where samples are far between; region by region, each seeing only what moves it, in principal modes
of what it does. At rest all terms vanish: the neutral face is exactly the scan.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..tissue.structures import Control
from .inputs import CENTRES, inputs_of
from .jaw_frame import JawFrame
from .spending import Spending

LENGTH = 2.5  # of the kernel, in the scaled coordinates of each region
#: What skin bends with, of a muscle: its progress, and this share of its activation in place of as much of that.
_ASKED = 0.4
#: Of the quadratic kernel, beside the Matérn's 1.
SQUARE = 0.03


def matern(squared: np.ndarray) -> np.ndarray:
    """Matérn 3/2 of squared distances (any shape), 1 at 0."""
    far = np.sqrt(np.maximum(squared, 0.0) * squared.dtype.type(3 / LENGTH**2))
    near = np.exp(-far)
    near += far * near
    return near


@dataclass(frozen=True, eq=False)
class Region:
    """Skin that is moved by the same: vertices (v,), and what its m modes are by kernel and force.

    weights (s, m) over the samples' kernels; linear (p, m) over the forces; modes (m, 3 v) mm
    """

    vertices: np.ndarray
    weights: np.ndarray
    linear: np.ndarray
    modes: np.ndarray


@dataclass(frozen=True, eq=False)
class Rig:
    """muscle_names of the head; sphincters: which of the k muscles that pull on skin are the lips' (-1: none); g regions.

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
    def _weight(self) -> np.ndarray:
        """(g, p) of each squared difference in the squared distance of two poses, and of each product in their product."""
        return np.ascontiguousarray(self.scale**2)

    @cached_property
    def _samples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(p, s) what the samples bent with, and their forces; (g, 1, s) the squared distance of each from rest, and its kernel
        with rest."""
        across, pulls = np.ascontiguousarray(self.samples.T), np.ascontiguousarray(self.pulls.T)
        far = (self._weight @ across**2)[:, None]
        return across, pulls, far, matern(far)

    @cached_property
    def _together(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All regions' linear parts side by side (p, total m), where each one's begins (g,), and their vertices (total v,)."""
        linear = np.concatenate([region.linear for region in self.regions], axis=1)
        first = np.cumsum([0, *(region.linear.shape[1] for region in self.regions)])
        return linear, first, np.concatenate([region.vertices for region in self.regions])

    def skin(self, control: Control) -> np.ndarray:
        """(n, 3) mm, the skin in a pose."""
        return self.frame.placed(self.own(self.inputs(control)[None])[0], control.jaw)

    def inputs(self, control: Control) -> np.ndarray:
        """(p,) the inputs of a control."""
        return inputs_of(self.muscle_names, control)

    def own(self, inputs: np.ndarray) -> np.ndarray:
        """(f, n, 3) mm: the skin's own motion for f rows of inputs (f, p)."""
        forces, bending = (x.astype(np.float32) for x in coordinates(self.spending, self.sphincters, inputs))
        linear, first, vertices = self._together
        modes = forces @ linear
        moved = []
        for region, kernel, at in zip(self.regions, self._kernels(forces, bending), first, strict=False):
            amount = kernel @ region.weights
            amount += modes[:, at : at + amount.shape[1]]
            moved.append(amount @ region.modes)
        out = np.zeros((len(inputs), len(self.frame.rest), 3), np.float32)
        out[:, vertices] = np.concatenate(moved, axis=1).reshape(len(inputs), -1, 3)
        return out

    def _kernels(self, forces: np.ndarray, bending: np.ndarray) -> np.ndarray:
        """(g, f, s) kernel of every pose with every sample as each region sees them, less what either has with rest."""
        across, pulls, far, rest = self._samples
        size = (self._weight @ (bending**2).T)[..., None]
        out = matern(far + size - 2 * np.stack([(self._weight * at) @ across for at in bending], axis=1))
        out -= matern(size) * rest
        product = np.stack([(self._weight * at) @ pulls for at in forces], axis=1)
        product *= product
        product *= np.float32(SQUARE)
        out += product
        return out


def coordinates(spending: Spending, sphincters, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the skin is linear in (f, p), forces, and what it bends with (f, p), between the progress of the muscles and what
    is asked of them; each followed by the other inputs. Forces count 1 for a muscle alone at its end. A muscle that has
    no entries in the tissue (of a lid) stays."""
    k = len(spending.mutual)
    activation, others = inputs[:, :k], inputs[:, k:].copy()
    forces, progress = spending.forces(activation, others)
    for at, muscle in zip(CENTRES, sphincters, strict=True):
        if muscle < 0:
            continue
        left = forces[:, muscle] / np.maximum(activation[:, muscle], 1e-6)
        others[:, at] *= np.where(activation[:, muscle] > 1e-6, left, 1.0)
    own = np.diag(spending.mutual)
    without = ~spending.mutual.any(axis=1)
    progress = np.where(without, activation, progress)
    bending = progress + _ASKED * (activation - progress)
    return np.concatenate([forces * (1 + own), others], axis=1), np.concatenate([bending, others], axis=1)
