# SPDX-License-Identifier: GPL-3.0-or-later
"""What acts on a head from outside, and how: gravity, the motion of the head itself, wind.

All is said in the head's own frame, in which the scan stands and bone is at rest. A frame that moves adds to each mass m
at r, moving by v in it, the inertial forces -m (a + w' x r + w x (w x r) + 2 w x v): of its linear acceleration, Euler's,
centrifugal, Coriolis's (Goldstein, Poole and Safko 2002, 4.10). The scan is at rest under gravity as it stands, so only the
change of gravity since counts: whoever lies on the back sags back, and in free fall, where gravity and the acceleration
cancel, the face has no weight.
"""

from dataclasses import dataclass, field

import numpy as np

#: mm/s², of a head in the scan's posture (ISO 80000-3).
STANDARD_GRAVITY = np.array([0.0, 0.0, -9806.65])
#: g/mm³, at sea level and 15 degrees Celsius (ISO 2533).
AIR = 1.225e-6


def _none() -> np.ndarray:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """All in the head's frame, whose origin is where the head's coordinates have theirs.

    gravity : (3,) mm/s²; as in the scan's posture by default
    acceleration, spin, spin_rate : (3,) mm/s² of the head's origin, rad/s and rad/s² of its turning
    wind : (3,) or one per skin vertex (n, 3) mm/s, of the air past the head
    """

    gravity: np.ndarray = field(default_factory=STANDARD_GRAVITY.copy)
    acceleration: np.ndarray = field(default_factory=_none)
    spin: np.ndarray = field(default_factory=_none)
    spin_rate: np.ndarray = field(default_factory=_none)
    wind: np.ndarray = field(default_factory=_none)

    @property
    def idle(self) -> bool:
        """Whether nothing acts that did not when the head was scanned."""
        others = (self.acceleration, self.spin, self.spin_rate, self.wind)
        return bool(np.all(self.gravity == STANDARD_GRAVITY)) and not any(np.any(x) for x in others)


def apparent_acceleration(around: Surroundings, positions, velocities=None) -> np.ndarray:
    """(k, 3) mm/s²: what masses at ``positions`` (k, 3) mm that move by ``velocities`` (k, 3) mm/s feel beyond the gravity
    of the scan's posture."""
    spin, rate = _cross(around.spin), _cross(around.spin_rate)
    field = rate + spin @ spin
    felt = np.tile((around.gravity - STANDARD_GRAVITY) - around.acceleration, (len(positions), 1))
    if field.any():
        felt -= positions @ field.T
    if spin.any() and velocities is not None:
        felt -= velocities @ (2 * spin.T)
    return felt


def _cross(v) -> np.ndarray:
    """(3, 3), the matrix of the cross product with ``v`` (3,)."""
    x, y, z = np.asarray(v, float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def wind_force(wind, normals, area) -> np.ndarray:
    """(k, 3) g mm/s²: skin with outward ``normals`` (k, 3) and ``area`` (k,) mm² in ``wind`` (3,) or (k, 3) mm/s.

    The pressure is that of the stagnating air on skin that faces it, ½ rho u², with the share cos² of skin that it meets
    aslant (Newton's impact theory: Anderson 2006, 3.2); skin in the lee feels none.
    """
    against = np.maximum(-np.einsum("ij,ij->i", np.broadcast_to(wind, normals.shape), normals), 0)
    return (-0.5 * AIR * area * against**2)[:, None] * normals


def outer_forces(model, around: Surroundings, positions, velocities, normals) -> np.ndarray | None:
    """(2 n, 3) g mm/s² on epidermis and fascia, None where nothing acts.

    positions, velocities (3 n, 3) mm and mm/s (velocities may be None: at rest); normals : function without arguments that
    returns the outward normals (n, 3) of the skin, called only if there is wind
    """
    if around.idle:
        return None
    n = model.count
    moving = None if velocities is None else velocities[: 2 * n]
    force = model.mass[:, None] * apparent_acceleration(around, positions[: 2 * n], moving)
    if np.any(around.wind):
        force[:n] += wind_force(around.wind, normals(), model.layers.area * model.exposed)
    return force
