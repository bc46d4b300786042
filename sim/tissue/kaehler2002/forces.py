# SPDX-License-Identifier: GPL-3.0-or-later
"""All that pulls on the skin in one energy: springs, volume and skull (Kähler et al. 2002, 4.2); and what the paper leaves
out: lids, contact, air in the cheeks, lips held together.
"""

import numpy as np

from ...mesh import vertex_normals
from .. import contact
from ..arch import arch_contacts
from ..planes import Planes, contact_energy, joined
from ..seal import seal_energy
from ..springs import spring_energy
from .posed import Pose
from .skull import skull_energy
from .structures import Model
from .volume import corner_gather, prism_stiffness, volume_energy


def energy_gradient(model: Model, pose: Pose, planes: Planes, positions) -> tuple[float, np.ndarray]:
    """Energy and its gradient (3 n, 3) over skin, feet and mirrored feet: what the feet bear goes to muscle and bone."""
    p = model.parameters
    energy, gradient = spring_energy(model.springs, positions)
    if len(model.prisms):
        if "gather" not in model.cache:
            model.cache["gather"] = corner_gather(model.prisms, len(positions))
        gather = model.cache["gather"]
        e, g = volume_energy(positions, model.prisms, model.prism_volume, p.volume, gather)
        energy, gradient = energy + e, gradient + g
    for e, g in (
        skull_energy(positions, model.skull, pose.rotation, pose.translation),
        contact_energy(planes, positions, p.contact * p.skin),
    ):
        energy, gradient = energy + e, gradient + g
    off = positions[pose.lid_node] - pose.lid_goal
    pulled = pose.lid_stiffness[:, None] * off
    energy += 0.5 * float(np.einsum("ij,ij->", pulled, off))
    np.add.at(gradient, pose.lid_node, pulled)
    if pose.puff:
        air = model.pressure
        push = pose.puff * p.puff * air.weight[:, None] * air.direction
        energy -= float(np.einsum("ij,ij->", push, positions[air.column] - model.rest[air.column]))
        gradient[air.column] -= push
    if pose.seal:
        e, force = seal_energy(model.seal, pose.seal * p.seal, positions)
        energy += e
        np.add.at(gradient, model.seal.lower, force)
        np.subtract.at(gradient, model.seal.upper, force)
    return energy, gradient


def find_contacts(model: Model, pose: Pose, skin) -> Planes:
    """Lips on lips and teeth, skin on eyeballs, the two faces of a lip: the planes near ``skin`` (n, 3)."""
    rest, triangles = model.rest[: model.count], model.contacts.triangles
    normals = vertex_normals(skin, triangles)
    if "rest_normals" not in model.cache:
        model.cache["rest_normals"] = vertex_normals(rest, triangles)
    return joined(
        *(contact.eye_planes(lids, skin, pose.gaze["lr".index(lids.side)]) for lids in model.lids),
        arch_contacts(model.contacts, skin, pose.rotation, pose.translation),
        contact.sheet_contacts(model.contacts, normals),
        contact.lip_contacts(model.contacts, skin, normals, rest, model.cache["rest_normals"]),
    )


def stiffness_at(model: Model, positions) -> np.ndarray:
    """(n,) a bound on the stiffness about each vertex at ``positions`` (3 n, 3): that of volume grows with area."""
    volume = prism_stiffness(positions, model.prisms, model.prism_volume, model.parameters.volume, model.count)
    return model.stiffness + volume


def contact_stiffness(model: Model, planes: Planes) -> np.ndarray:
    """(n,) stiffness that contact may lend each vertex."""
    k = 2 * model.parameters.contact * model.parameters.skin
    both = np.concatenate([planes.node, planes.partner[planes.partner >= 0]])
    return np.bincount(both, np.full(len(both), k), minlength=model.count)[: model.count]
