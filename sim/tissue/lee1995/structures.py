# SPDX-License-Identifier: GPL-3.0-or-later
"""Model and State of the 1995 face: what it has beside or instead of `tissue.structures`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...anatomy.head import Eye, Jaw
from ..structures import Layers, Lids, Springs, State
from .constants import Constants


@dataclass(frozen=True, eq=False)
class Elements:
    """The prisms (3.1) and what 3.6 needs of them.

    prisms (t, 6) nodes, three of the epidermis and three of the fascia below; volume (t,) mm³ at rest
    epidermal : sparse (n, t), sums elements into their epidermal nodes
    gather : sparse (3 n, 6 t), sums corners, the first of all elements first, into their nodes
    about : sparse (3 n, 3 n), positions -> p of 3.6, about the centre of mass of each element, summed over elements
    """

    prisms: np.ndarray
    volume: np.ndarray
    epidermal: Any
    gather: Any
    about: Any


@dataclass(frozen=True, eq=False)
class Attachments:
    """The fascia that each muscle pulls (3.4, 3.5). Entry e: muscle ``owner[e]`` pulls column ``column[e]``.

    force : (e, 3) at activation 1 and strength 1, of unit size where it is full
    tie : (e,) share by which the force turns with the mandible (muscles that arise from it)
    lip : (e,) 0 for the upper lip's sphincter, 1 for the lower lip's, -1 for other muscles
    forward : (e, 3) what `Control.lips` 1 adds to the force
    strength : (k,) g mm/s²; excursion : (k,) mm of skin motion expected at activation 1
    """

    names: tuple[str, ...]
    owner: np.ndarray
    column: np.ndarray
    force: np.ndarray
    tie: np.ndarray
    lip: np.ndarray
    forward: np.ndarray
    strength: np.ndarray
    excursion: np.ndarray


@dataclass(frozen=True, eq=False)
class LeeModel:
    """A head ready to act, built once by `model.build_model`.

    layers : `free` marks the nodes that obey the equations of motion; bone, lids and the back of the head do not
    restoration : (3 n,) g/s², the nodal restoration of 3.8
    lid_rest : for each of `lids`, where its own geometry has its columns at rest, (v, 3) mm
    bones : skull and mandible as `contact.build_bones` samples them
    puff : (3 n, 3) force of `Control.cheeks` 1
    time_step : s, the paper's, or what is stable if that is less
    """

    constants: Constants
    layers: Layers
    springs: Springs
    elements: Elements
    restoration: np.ndarray
    muscles: Attachments
    lids: tuple[Lids, ...]
    lid_rest: tuple[np.ndarray, ...]
    bones: tuple
    contacts: Any
    puff: np.ndarray
    time_step: float
    jaw: Jaw
    eyes: tuple[Eye, Eye]
    faces: np.ndarray
    triangles: np.ndarray
    rest_normals: np.ndarray
    rigid: dict[str, np.ndarray]

    @property
    def count(self) -> int:
        """Number of skin vertices."""
        return len(self.layers.area)

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names in the order of `Control.activations`."""
        return self.muscles.names


@dataclass(frozen=True, eq=False)
class LeeState(State):
    """A state, and the posed rest (3 n, 3) that it belongs to: where nodes would be without muscles."""

    reference: np.ndarray
