# SPDX-License-Identifier: GPL-3.0-or-later
"""What is left of penetration when a pose has come to rest, measured surface by surface, and the skin moved clear of it.

Contact forces leave a little penetration, a wall round a row of teeth is not each tooth, and bone is more than its
tangent planes. So at the end the drawn surface is held against the solids themselves, and moved out of them by the
least motion of the vertices that does it.
"""

import numpy as np
from scipy import sparse

from ..mesh import vertex_normals
from .drawn_contact import OFF_BONE, eye_contacts
from .drawn_lips import lip_contacts
from .drawn_samples import planes_of
from .flesh import flesh_contacts
from .lid_meeting import met
from .planes import empty_planes, joined, project, row_depths, touching
from .structures import Model

#: Pairs of surfaces whose penetration is told apart.
PAIRS = ("lip_lip", "lid_eyeball", "skin_teeth", "cheek_gum", "fascia_skull")
#: mm of penetration that is left alone, and by which the rest is overdone; rounds of looking and moving.
LEAVE, MORE, ROUNDS = 0.02, 0.02, 12
#: mm that a point is moved in one round, at most; steps to find out how.
FAR = 0.4
SWEEPS = 20
#: Points in too deep up to which dense tables are faster than sparse ones.
DENSE = 120
#: mm between points of the lips that may have gone through each other.
LIP_REACH = 4.0
_ENAMEL = 0


def surfaces_of(model: Model, pose, positions, off_bone: float = 0.0) -> dict:
    """Pair of `PAIRS` -> `Planes` of what is nearly in touch at ``positions`` (3 n, 3), as exact as the drawn surface;
    fascia ``off_bone`` mm from bone where it has that at rest."""
    n = model.count
    skin, drawn = positions[:n], model.drawn
    at = pose.rotation, pose.translation
    normals = vertex_normals(skin, model.contacts.triangles)
    found = {
        "lip_lip": lip_contacts(drawn.fine_lips, skin, normals, 0.0, LIP_REACH),
        "lid_eyeball": [eye_contacts(before, skin, pose.gaze_of(before.of.side), 0.0) for before in drawn.eyes],
        "skin_teeth": [],
        "cheek_gum": [],
    }
    for within in drawn.rows_of_teeth:
        points = within.points.at(skin)
        rows, normal, height, material = within.solid.planes(points, *at, reach=2.0)
        level = np.einsum("ij,ij->i", points[rows], normal) - height + within.kept[rows]
        for name, chosen in (("skin_teeth", material == _ENAMEL), ("cheek_gum", material != _ENAMEL)):
            found[name].append((*within.points.along(rows[chosen], normal[chosen]), level[chosen]))
    bones = [empty_planes()]
    for within in drawn.bones:
        fascia = positions[n + within.points]
        rows, normal, height, _ = within.solid.planes(fascia, *at, reach=8.0)
        level = np.einsum("ij,ij->i", fascia[rows], normal) - height + np.minimum(within.kept[rows], off_bone)
        bones.append(touching(n + within.points[rows], normal, level))
    return {name: planes_of(pieces, n) for name, pieces in found.items()} | {"fascia_skull": joined(*bones)}


def cleared(model: Model, pose, positions) -> np.ndarray:
    """(3 n, 3) mm: ``positions`` with the drawn skin out of eyeballs, teeth, gums and the other lip, flesh between
    skin and lining, fascia out of bone, and shut lids met; as after the round that left the least."""
    out = met(model, pose.shut, positions)
    n = model.count
    skin, least = out[:n], np.inf
    for _ in range(ROUNDS + 1):
        found = surfaces_of(model, pose, out, OFF_BONE)
        found["flesh"] = planes_of([flesh_contacts(model.drawn.flesh, out[:n])], n)
        out = project(found.pop("fascia_skull"), out, rounds=1)
        planes = joined(*found.values())
        left = np.sum(np.maximum(row_depths(planes, out) - LEAVE, 0) ** 2)
        if left < least:  # where skin is crumpled, normals mislead, and each way out may lead deeper in
            skin, least = out[:n].copy(), left
        move = way_out(planes, out, model.layers.free[:n])
        if move is None:
            break
        out[:n] += move
    out[:n] = skin
    return out


def way_out(planes, positions, free, kept: float = 0.0) -> np.ndarray | None:
    """(n, 3) mm by which the ``free`` (n,) vertices move so that what is drawn leaves the ``planes`` it is in by more than
    ``kept`` mm, or None where it is in none; one round, of no more than 2 `FAR`."""
    depth = row_depths(planes, positions) - kept
    hit = np.flatnonzero(depth > LEAVE)
    if not len(hit):
        return None
    move = _least_motion(planes.rows[hit], np.minimum(depth[hit], FAR) + MORE, free)
    size = np.linalg.norm(move, axis=1, keepdims=True)
    return move * np.minimum(1, 2 * FAR / np.maximum(size, 1e-9))


def _least_motion(rows, wanted, free):
    """(n, 3) mm, about the smallest motion of the ``free`` (n,) vertices by which ``rows @ motion`` (c,) is at least
    ``wanted`` (c,): surfaces push, they do not pull, so by projected Jacobi steps on the pushes."""
    used, place = np.unique(rows.indices, return_inverse=True)
    free = np.repeat(free, 3)
    near = sparse.csr_matrix((rows.data * free[rows.indices], place, rows.indptr), (len(wanted), len(used)))
    if len(wanted) < DENSE:
        near = near.toarray()
    product = near @ near.T
    size = np.maximum(np.asarray(abs(product).sum(axis=1)).ravel(), 1e-9)
    push = wanted / size
    for _ in range(SWEEPS):
        push = np.maximum(push + (wanted - product @ push) / size, 0)
    move = np.zeros(len(free))
    move[used] = near.T @ push
    return move.reshape(-1, 3)
