# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles that are spent: how much force each still has, given what all the others have done already.

A muscle's force fades with its progress: activation x (1 - progress / reach). Progress is nearly linear in the forces of
all muscles, its own among them, so that forces follow from one small linear system. Most of what is nonlinear about a
face lies in it: a second muscle that pulls the same way finds the first one's work done, an antagonist stretches it anew.
"""

from dataclasses import dataclass

import numpy as np

from ..tissue.energy import pose_of
from ..tissue.muscle_field import JAW_MUSCLES, base_name
from ..tissue.structures import Control, Model, State

#: Ridge of the regression, share of the inputs' mean square, each scaled to 1.
_RIDGE = 1e-3


@dataclass(frozen=True, eq=False)
class Spending:
    """mutual (k, k): progress over reach of muscle i by a unit force of muscle j; beside (k, o): by the other inputs."""

    mutual: np.ndarray
    beside: np.ndarray

    def forces(self, activations: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (..., k), 0 where a muscle is spent, and progress (..., k), from (..., k) and (..., o).

        b = a (1 - G b - H o), solved for b.
        """
        activations, others = np.asarray(activations, float), np.asarray(others, float)
        outside = others @ self.beside.T
        system = np.eye(len(self.mutual)) + activations[..., None] * self.mutual
        b = np.linalg.solve(system, (activations * (1 - outside))[..., None])[..., 0]
        b = np.maximum(b, 0.0)
        return b, b @ self.mutual.T + outside


def progress_of(model: Model, control: Control, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Mean progress over reach (k,) of each muscle that pulls on skin, and the share of its force that is left (k,)."""
    pose = pose_of(model, control)
    field, n = model.muscles, model.count
    pull = field.direction + field.tie[:, None] * (field.direction @ pose.rotation.T - field.direction)
    node = field.column + n
    ratio = np.einsum("ij,ij->i", state.positions[node] - pose.reference[node], pull) / field.reach[field.owner]
    k = len(field.names)
    whole = np.maximum(np.bincount(field.owner, field.weight, minlength=k), 1e-9)
    progress = np.bincount(field.owner, field.weight * ratio, minlength=k) / whole
    left = np.bincount(field.owner, field.weight * np.maximum(1 - ratio, 0), minlength=k) / whole
    keep = [i for i, name in enumerate(field.names) if base_name(name) not in JAW_MUSCLES]
    has = np.bincount(field.owner, minlength=k)[keep] > 0
    return progress[keep], np.where(has, left[keep], 1.0)


def fit_spending(activations, others, progress, left) -> Spending:
    """Least squares over samples: progress (s, k) from forces activations x left (s, k) and others (s, o).

    A muscle never lengthens by its own force; where samples would have it so, its own share is 0.
    """
    k = activations.shape[1]
    inputs = np.concatenate([activations * left, others], axis=1)
    scale = np.maximum(np.sqrt((inputs**2).mean(axis=0)), 1e-9)
    gram = (inputs / scale).T @ (inputs / scale)
    gram += _RIDGE * len(inputs) * np.eye(len(gram))
    found = (np.linalg.solve(gram, (inputs / scale).T @ progress) / scale[:, None]).T
    mutual, beside = found[:, :k].copy(), found[:, k:]
    np.fill_diagonal(mutual, np.maximum(np.diag(mutual), 0.0))
    return Spending(mutual, beside)
