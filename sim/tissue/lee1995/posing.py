# SPDX-License-Identifier: GPL-3.0-or-later
"""What a control means for a model: where bone and lids are, the posed rest of the tissue, the forces that muscles apply."""

from dataclasses import dataclass

import numpy as np

from ..energy import posed_reference
from ..jaw import jaw_transform
from ..lid_targets import lid_targets
from ..structures import Control, require_control
from .structures import LeeModel
from .volume import turned_rest

#: Lid skin held to its lid at least this much is carried by it (4.2: "blink kinematically"); the rest is tissue.
HELD = 0.25


@dataclass(frozen=True, eq=False)
class Pose:
    """reference (3 n, 3) posed rest; shape (3 n, 3) from `volume.turned_rest`; force (3 n, 3) applied; rotation,
    translation of the mandible; gaze (2, 2) rad of left and right eye."""

    reference: np.ndarray
    shape: np.ndarray
    force: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    gaze: np.ndarray


def pose_of(model: LeeModel, control: Control) -> Pose:
    """The constants of motion for ``control``. Raises `InputError` where that is no control of the model."""
    require_control(control)
    n = model.count
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    reference = posed_reference(model, rotation, translation)
    closure = np.asarray(control.lids, float).reshape(2, 2)
    for lids, rest in zip(model.lids, model.lid_rest, strict=True):
        shift = lid_targets(lids, *closure["lr".index(lids.side)], control.gaze_of(lids.side)) - rest
        for layer in range(2):
            reference[lids.column + layer * n] += shift
    shape = turned_rest(model.elements, model.layers.nodes, model.layers.jaw, rotation)
    force = applied_forces(model, control, rotation)
    return Pose(reference, shape, force, rotation, translation, np.array([control.gaze_of(side) for side in "lr"]))


def applied_forces(model: LeeModel, control: Control, rotation: np.ndarray) -> np.ndarray:
    """(3 n, 3) f of 3.8: the muscles at their activations, and the air in the cheeks."""
    m = model.muscles
    n = model.count
    activation = control.contractions(len(model.muscle_names))
    size = activation[m.owner] * m.strength[m.owner]
    pull = m.force + m.tie[:, None] * (m.force @ rotation.T - m.force)  # roots in the jaw turn with it
    pull = pull + np.append(np.clip(control.lips, -1, 1), 0.0)[m.lip][:, None] * m.forward
    force = float(np.clip(control.cheeks, -1, 1)) * model.puff
    for axis in range(3):
        force[:, axis] += np.bincount(m.column + n, size * pull[:, axis], minlength=3 * n)
    return force
