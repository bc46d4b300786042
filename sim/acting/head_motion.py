# SPDX-License-Identifier: GPL-3.0-or-later
"""A head that moves through a room: where it is frame by frame, and what its face feels of that.

The room has the scan's axes: a head that has not turned stands in it as it was scanned. What is felt is told in the
head's own frame (`tissue.surroundings`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..tissue.surroundings import STANDARD_GRAVITY, Surroundings


@dataclass(frozen=True, eq=False)
class HeadMotion:
    """Rotations (k, 3, 3) from the head's axes to the room's and positions (k, 3) mm of its origin in the room, at
    ``fps`` frames a second."""

    rotations: np.ndarray
    positions: np.ndarray
    fps: float

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def still(self) -> bool:
        """Whether the head neither moves nor turns, nor has turned from the scan's posture."""
        return bool((self.rotations == np.eye(3)).all() and (self.positions == self.positions[:1]).all())


def standing(count: int, fps: float) -> HeadMotion:
    """A head that stays where it was scanned, for ``count`` frames."""
    return HeadMotion(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), fps)


def rotation(turn: float, nod: float, tilt: float) -> np.ndarray:
    """(3, 3) from the head's axes to the room's, of a head that turned to its left about its own vertical, then nodded
    down about the axis between its ears, then tilted to its left shoulder; rad."""
    return Rotation.from_euler("ZXY", [turn, nod, tilt]).as_matrix()


def felt(motion: HeadMotion, gravity=STANDARD_GRAVITY, wind=None, moving: bool = True) -> list[Surroundings]:
    """What acts on the face at every frame.

    gravity : (3,) or (k, 3) mm/s² in the room
    wind : (k, 3) or one per skin vertex (k, n, 3) mm/s of the air in the room; None where air moves with the head
    moving : with inertial forces, by central differences over the frames beside; else gravity and wind alone

    Before the first frame and after the last the head is taken to move on evenly.
    """
    count = len(motion)
    inward = motion.rotations.transpose(0, 2, 1)
    weight = np.einsum("kij,kj->ki", inward, np.broadcast_to(np.asarray(gravity, float), (count, 3)))
    still = (motion.rotations == np.eye(3)).all(axis=(1, 2))
    weight[still] = np.broadcast_to(gravity, (count, 3))[still]
    rate, push, spin, spin_rate = _derivatives(motion)
    if wind is not None:
        air = np.asarray(wind, float)
        air = air - (rate if air.ndim == 2 else rate[:, None])
        blown = np.einsum("kij,k...j->k...i", inward, air)
    frames = []
    for k in range(count):
        inertial = {}
        if moving:
            inertial = {"acceleration": inward[k] @ push[k], "spin": spin[k], "spin_rate": spin_rate[k]}
        if wind is not None:
            inertial["wind"] = blown[k]
        frames.append(Surroundings(gravity=weight[k], **inertial))
    return frames


def _derivatives(motion: HeadMotion):
    """Velocity and acceleration (k, 3) in the room, spin and its rate (k, 3) in the head's frame."""
    count, fps = len(motion), motion.fps
    if count < 2:
        return (np.zeros((count, 3)),) * 4
    step = np.diff(motion.positions, axis=0) * fps
    step = np.concatenate([step[:1], step, step[-1:]])
    turns = Rotation.from_matrix(motion.rotations)
    turned = (turns[:-1].inv() * turns[1:]).as_rotvec() * fps
    turned = np.concatenate([turned[:1], turned, turned[-1:]])
    mean = [(x[:-1] + x[1:]) / 2 for x in (step, turned)]
    change = [np.diff(x, axis=0) * fps for x in (step, turned)]
    return mean[0], change[0], mean[1], change[1]
