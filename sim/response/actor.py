# SPDX-License-Identifier: GPL-3.0-or-later
"""A head that a rig acts: has what `pose.control` and `posing.posed_parts` read of a model, and needs no tissue."""

from dataclasses import dataclass

import numpy as np

from ..anatomy.head import JAW_PARTS, Eye, Head, Jaw
from ..tissue.structures import Control
from .rig import Rig


@dataclass(frozen=True, eq=False)
class Skin:
    """A state without tissue: skin (n, 3) mm."""

    skin: np.ndarray


@dataclass(frozen=True, eq=False)
class Actor:
    """rigid: vertices at rest of the parts that move rigidly."""

    rig: Rig
    jaw: Jaw
    eyes: tuple[Eye, Eye]
    rigid: dict[str, np.ndarray]

    @property
    def count(self) -> int:
        """Number of skin vertices."""
        return len(self.rig.frame.rest)

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names in the order of `Control.activations`."""
        return self.rig.muscle_names

    def rest_state(self) -> Skin:
        """The head itself."""
        return Skin(self.rig.frame.rest.copy())

    def state(self, control: Control) -> Skin:
        """The skin in a pose, in about a millisecond."""
        return Skin(self.rig.skin(control))


def actor_of(rig: Rig, head: Head) -> Actor:
    """``head`` acted by ``rig``."""
    parts = (*JAW_PARTS, "eye_l", "eye_r", "skull", "teeth_upper")
    return Actor(rig, head.jaw, head.eyes, {p: head.parts[p].vertices for p in parts if p in head.parts})
