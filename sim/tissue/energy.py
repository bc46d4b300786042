# SPDX-License-Identifier: GPL-3.0-or-later
"""All forces of Lee, Terzopoulos and Waters 1995, 3.8 as the gradient of one energy of the free nodes (`forces`).

springs g (3.3) + volume q (3.6) + nodal restoration h, with the bending of the skin sheet + muscles f (3.4, 3.5) +
lids + contact s (3.7). The restoration pulls to the *posed rest*: where the node would be if the tissue only followed
the jaw. Everything but springs, volume, contact and spent muscles is quadratic, with one matrix for all poses.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..mesh import vertex_normals
from . import contact
from .drawn_contact import drawn_contacts, on_the_ball
from .jaw import jaw_transform
from .lid_meeting import shut_share
from .lid_targets import lid_targets
from .muscle_field import turned_lips
from .planes import Planes, joined
from .structures import Control, Model, require_control
from .surroundings import Surroundings, outer_forces
from .volume import corner_gather


@dataclass(frozen=True, eq=False)
class Pose:
    """What a control means for a model: everything that does not change while solving.

    reference (3 n, 3): posed rest; rotation, translation of the mandible; pull (e, 3), push (e,), reach (e,), node (e,)
    of the active muscle entries and of the air in the mouth; lid_node (v,), lid_goal (v, 3), lid_stiffness (v,);
    gaze (2, 2) of left and right eye; seal 0..1 of the lips; shut (2,) 0..1 how far each
    eye's lids count as shut; load (3, 2 n) outer forces on epidermis and fascia in the unit
    of stiffness times mm, or None.
    """

    reference: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    node: np.ndarray
    pull: np.ndarray
    push: np.ndarray
    reach: np.ndarray
    lid_node: np.ndarray
    lid_goal: np.ndarray
    lid_stiffness: np.ndarray
    gaze: np.ndarray
    seal: float
    shut: np.ndarray
    load: np.ndarray | None = None

    def gaze_of(self, side: str) -> np.ndarray:
        """(2,) rad, of the eye on ``side`` ("l" or "r")."""
        return self.gaze["lr".index(side)]


def posed_reference(model: Model, rotation, translation) -> np.ndarray:
    """(3 n, 3) mm: every node moved by its share with the mandible; the throat sinks besides as the jaw turns down."""
    layers, jaw = model.layers, model.jaw
    rows, share = layers.carried
    out, rest = layers.nodes.copy(), layers.nodes[rows]
    out[rows] += share * (rest @ rotation.T + translation - rest)
    ahead = jaw.incisor - (jaw.condyle_l + jaw.condyle_r) / 2
    out[:, 2] += (rotation @ ahead - ahead)[2] * layers.sink
    return out


def pose_of(model: Model, control: Control, lid_goal: np.ndarray | None = None) -> Pose:
    """The constants of a solve for ``control``; ``lid_goal`` (v, 3) mm as in `Pose` where it is known already.
    Raises `InputError` where that is no control of the model."""
    require_control(control)
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    reference = posed_reference(model, rotation, translation)
    m = model.muscles
    n = model.count
    activation = control.contractions(len(model.muscle_names))
    push = activation[m.owner] * m.strength[m.owner] * m.weight
    on = np.flatnonzero(push > 0)
    direction = m.direction[on]
    turned = direction @ rotation.T
    direction = direction + m.tie[on, None] * (turned - direction)
    if np.any(control.lips):
        direction = turned_lips(m, on, direction, control.lips)
    air = model.pressure
    puff = float(np.clip(control.cheeks, -1, 1))
    blown = len(air.column) if puff else 0
    if lid_goal is None:
        goals = [
            _lid_goal(model, before, closure, control.gaze_of(before.of.side))
            for before, closure in zip(model.drawn.eyes, _lids_of(model, control), strict=True)
        ]
        lid_goal = np.concatenate([*goals, np.zeros((0, 3))])
    lid_node = np.concatenate([*(lids.column for lids in model.lids), np.zeros(0, int)])
    lid_hold = np.concatenate([*(lids.hold for lids in model.lids), np.zeros(0)])
    return Pose(
        reference=reference,
        rotation=rotation,
        translation=translation,
        node=np.concatenate([m.column[on], air.column[:blown]]) + n,
        pull=np.concatenate([direction, np.sign(puff) * air.direction[:blown]]),
        push=np.concatenate([push[on], abs(puff) * air.strength * air.weight[:blown]]),
        reach=np.concatenate([m.reach[m.owner[on]], np.full(blown, air.reach)]),
        lid_node=lid_node,
        lid_goal=lid_goal,
        lid_stiffness=model.parameters.lid * lid_hold,
        gaze=np.array([control.gaze_of(side) for side in "lr"]),
        seal=float(np.clip(control.seal, 0, 1)),
        shut=_shut(model, control),
        load=load_at(model, control.around, reference),
    )


def load_at(model: Model, around: Surroundings, positions, velocities=None) -> np.ndarray | None:
    """`Pose.load` of nodes at ``positions`` (3 n, 3) mm with ``velocities`` (3 n, 3) mm/s (at rest by default)."""
    triangles = model.contacts.triangles
    force = outer_forces(
        model, around, positions, velocities, lambda: vertex_normals(positions[: model.count], triangles)
    )
    return None if force is None else force.T / model.parameters.dynamic_scale


def _lid_goal(model: Model, before, closure, gaze) -> np.ndarray:
    """(v, 3) mm: where the lids of one eye are to go, what is drawn of them on the eyeball."""
    goal = lid_targets(before.of, closure[0], closure[1], gaze) + _lid_offset(model, before.of)
    return on_the_ball(before, model.layers.nodes[: model.count], goal, gaze)


def _lid_offset(model: Model, lids) -> np.ndarray:
    """(v, 3) mm to add to the lids' targets, so that the scan's own lids stay where they are at rest."""
    key = "lid_offset", lids.side
    if key not in model.cache:
        model.cache[key] = model.layers.nodes[lids.column] - lid_targets(lids, 0.0, 0.0, np.zeros(2))
    return model.cache[key]


def _lids_of(model: Model, control: Control):
    closure = np.asarray(control.lids, float).reshape(2, 2)
    return [closure["lr".index(lids.side)] for lids in model.lids]


def _shut(model: Model, control: Control) -> np.ndarray:
    shut = np.zeros(2)
    for lids, closure in zip(model.lids, _lids_of(model, control), strict=True):
        shut["lr".index(lids.side)] = shut_share(lids, closure)
    return shut


def bending_stiffness(model: Model) -> float:
    """Bending of the sheet (epidermis and fascia) from its stretching and `Parameters.bending_length`."""
    p = model.parameters
    return (p.epidermis + p.fascia) * p.bending_length**2


def system_matrix(model: Model) -> dict:
    """The constant parts over the m free nodes: quadratic matrix Q, solver matrix A, helpers.

    free : (m,) nodes; row : (3 n,) the place of each node among them, m for those that are not
    """
    layers, springs, p = model.layers, model.springs, model.parameters
    n = model.count
    laplacian = model.bending
    bend = bending_stiffness(model) * (laplacian.T @ sparse.diags(np.sqrt(layers.sheet) / layers.area) @ laplacian)
    hold = np.concatenate([0.15 * layers.restoration, 0.85 * layers.restoration])
    quadratic = sparse.block_diag([0.7 * bend, 0.3 * bend], format="csr") + sparse.diags(hold)
    lid = np.zeros(2 * n)
    for lids in model.lids:
        lid[lids.column] += p.lid * lids.hold
    stretch = springs.gather @ sparse.diags(springs.stiffness) @ springs.difference
    full = quadratic + stretch[: 2 * n, : 2 * n] + sparse.diags(lid) + _volume_matrix(model)
    free = np.flatnonzero(layers.free)
    row = np.full(3 * n, len(free))
    row[free] = np.arange(len(free))
    return {
        "quadratic": quadratic[free][:, free].tocsr(),
        "system": full[free][:, free].tocsc(),
        "free": free,
        "row": row,
        # forces of springs, then of prism corners, onto the free nodes
        "gather": sparse.hstack([springs.gather[free], corner_gather(model.prisms, 3 * n)[free]], format="csr"),
    }


def _volume_matrix(model: Model):
    """Volume's share of the solver matrix, as springs: over the edges of each prism, along and across the layers."""
    n = model.count
    if not len(model.prisms):
        return sparse.csr_matrix((2 * n, 2 * n))
    k = model.parameters.volume
    corner = model.layers.nodes[model.prisms]
    side = corner[:, 1:3] - corner[:, :1]
    area = np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1) / 2
    height = model.prism_volume / np.maximum(area, 1e-6)
    across = k * area**2 / (3 * model.prism_volume)
    along = 0.25 * k * height
    pairs = [((i, i + 3), across) for i in range(3)]
    pairs += [((i + s, (i + 1) % 3 + s), along) for i in range(3) for s in (0, 3)]
    first = np.concatenate([model.prisms[:, i] for (i, _), _ in pairs])
    second = np.concatenate([model.prisms[:, j] for (_, j), _ in pairs])
    weight = np.concatenate([w for _, w in pairs])
    off = sparse.csr_matrix((weight, (first, second)), (2 * n, 2 * n))
    off = off + off.T
    return sparse.diags(np.asarray(off.sum(axis=1)).ravel()) - off


def find_contacts(model: Model, pose: Pose, positions, nearby=None) -> Planes:
    """The planes that matter near ``positions`` (3 n, 3).

    nearby : `Nearby`, for positions that follow each other closely: what is far away is looked at more seldom then
    """
    n = model.count
    skin = positions[:n]
    normals = vertex_normals(skin, _facing(model))
    jaw = pose.rotation, pose.translation
    return joined(
        contact.bone_planes(model.contacts.bones, model.layers, positions[n : 2 * n], *jaw, nearby),
        contact.sheet_contacts(model.contacts, normals),
        drawn_contacts(model.drawn, skin, normals, *jaw, pose.gaze_of, nearby),
    )


def _facing(model: Model) -> np.ndarray:
    """(t, 3) the triangles at the vertices whose normals contacts ask for: those of the lips and of sheets back to back."""
    if "facing" not in model.cache:
        asked = np.zeros(model.count, bool)
        asked[model.contacts.sheets[:, 1]] = True
        for lip in model.drawn.lips.points:
            asked[lip.rows.indices] = True
        triangles = model.contacts.triangles
        model.cache["facing"] = triangles[asked[triangles].any(axis=1)]
    return model.cache["facing"]
