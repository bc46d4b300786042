# SPDX-License-Identifier: GPL-3.0-or-later
"""The equations of motion and their numerical solution: Lee, Terzopoulos and Waters 1995, 3.8 and 3.9.

m a + gamma v + g + q + s + h = f. In 3.8 the inner forces stand on the left, as what resists; the functions here return
what acts on the nodes, so that a = (f + g + q + h + s - gamma v) / m. Explicit Euler as in 3.9: the new velocity moves
the node.
"""

import numpy as np

from ...mesh import vertex_normals
from .. import arch, contact
from ..planes import Planes, joined
from .posing import Pose
from .skull import arrested, heights, skull_forces
from .stress_strain import spring_forces
from .structures import LeeModel, LeeState
from .volume import volume_forces

_REACH = 6.0  # mm: no node comes farther until planes are looked for anew
#: The planes that nodes may not pass: the bone's, and all others.
Barriers = tuple[Planes, Planes]


def net_forces(model: LeeModel, pose: Pose, planes: Barriers, positions: np.ndarray) -> np.ndarray:
    """(3 n, 3) of all forces but damping, after the skull has cancelled what points into it."""
    c = model.constants
    force = pose.force + spring_forces(model.springs, positions)
    force += volume_forces(model.elements, positions, pose.shape, c)
    force -= model.restoration[:, None] * (positions - pose.reference)
    for each in planes:
        force += skull_forces(each, positions, force)
    return force


def barriers(model: LeeModel, pose: Pose, positions: np.ndarray) -> Barriers:
    """What tissue may not enter where it is now: the bone under the fascia, and for the skin, that it slides over
    likewise, its own other side, the other lip, each row of teeth and the eyeballs."""
    n = model.count
    at = pose.rotation, pose.translation
    skin = positions[:n]
    bone = contact.bone_planes(model.bones, model.layers, positions[n : 2 * n], *at)
    teeth = arch.arch_contacts(model.contacts, skin, *at)
    eyes = [contact.eye_planes(lids, skin, pose.gaze["lr".index(lids.side)]) for lids in model.lids]
    normals = vertex_normals(skin, model.triangles)
    flesh = contact.sheet_contacts(model.contacts, normals)
    lips = contact.lip_contacts(model.contacts, skin, normals, model.layers.nodes[:n], model.rest_normals)
    free = np.concatenate([model.layers.free, np.zeros(n + 1, bool)])  # the last one: no partner
    return _near(bone, positions, free), _near(joined(flesh, lips, *eyes, teeth), positions, free)


def _near(planes, positions, free):
    keep = (heights(planes, positions) < _REACH) & (free[planes.node] | free[planes.partner])
    return Planes(planes.node[keep], planes.normal[keep], planes.level[keep], planes.partner[keep])


def euler_step(
    model: LeeModel, pose: Pose, planes: Barriers, state: LeeState, dt: float, damping: float | None = None
) -> LeeState:
    """One step of 3.9. Bone nodes and lids stand where the pose has them; damping in g/s, the paper's by default."""
    c = model.constants
    gamma = c.damping if damping is None else damping
    n = model.count
    free = np.concatenate([model.layers.free, np.zeros(n, bool)])[:, None]
    force = net_forces(model, pose, planes, state.positions)
    acceleration = (force - gamma * state.velocities) / c.mass
    velocities = state.velocities + dt * acceleration
    for each in planes:
        velocities = arrested(each, state.positions, velocities, dt)
    velocities = np.where(free, velocities, 0.0)
    return LeeState(np.where(free, state.positions + dt * velocities, pose.reference), velocities, pose.reference)
