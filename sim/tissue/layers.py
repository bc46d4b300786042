# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of tissue under every skin vertex: epidermis, fascia, bone (Lee, Terzopoulos and Waters 1995, 3.1, figure 6).

A column stands on bone where bone lies close and in front of it along the inward direction. Lips, lids, cheeks over the
mouth, nostrils, ears and neck have none: there the third node is a soft anchor inside the flesh that moves with the jaw
by the head's own share, tied weakly, so that they move freely and still come back to the scan.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head, require_head
from ..errors import InputError
from ..mesh import vertex_areas, vertex_normals
from .geometry import Surface, cotangent_stiffness, short_diagonals, smoothed
from .gingiva import ATTACHED, attached
from .parameters import Parameters
from .structures import Layers
from .throat import build_throat

#: Boneless places: depth in mm from skin to fascia, factor on the restoration, on the muscle-layer springs, on the
#: sheet. Later rows win where groups overlap.
_SOFT = {
    "cheek": (3.5, 0.2, 0.15, 1.0),
    "mouth_bag": (1.2, 0.8, 0.3, 0.15),
    "lip_upper": (2.2, 0.4, 0.1, 0.45),
    "lip_lower": (2.2, 0.25, 0.1, 0.45),
    "lid_upper": (0.9, 0.3, 0.2, 0.06),
    "lid_lower": (0.9, 0.3, 0.2, 0.12),
    "nostril": (1.2, 1.2, 0.6, 1.0),
    "ear": (1.5, 4.0, 1.0, 1.0),
    "neck": (4.0, 0.5, 0.5, 1.0),
}
#: All else without bone within reach (the floor of the mouth, the neck under the jaw).
_OTHER = (3.5, 0.5, 0.4)
_REACH = 24.0
#: mm between which a head's skin is from end to end, with neck and bust or without.
_SIZES = (50.0, 2000.0)


def _sides(groups, name):
    names = [name] if name in groups else [name + "_l", name + "_r"]
    found = [groups[n] for n in names if n in groups]
    return np.clip(np.sum(found, axis=0), 0, 1) if found else 0.0


def _require_millimetres(head: Head) -> None:
    for name, mesh in head.parts.items():
        if not np.isfinite(mesh.vertices).all():
            raise InputError(f"The head's {name} has vertices in places that are no finite numbers: correct them.")
    size = float(np.ptp(head.skin.vertices, axis=0).max(initial=0.0))
    if not _SIZES[0] < size < _SIZES[1]:
        raise InputError(f"The head's skin is {size:.3g} mm from end to end, which no head is: give it in millimetres.")


def build_layers(head: Head, parameters: Parameters) -> Layers:
    """The columns of ``head``; the rest position of every node.

    Raises
    ------
    InputError : it is no head, a part of it is in places that are none, or it is not in millimetres.
    """
    require_head(head)
    _require_millimetres(head)
    skin = head.skin
    v, tri = skin.vertices, short_diagonals(skin.vertices, skin.faces)
    n = len(v)
    groups = {k: np.asarray(w, float) for k, w in head.groups.items()}
    normal = vertex_normals(v, tri)
    area = vertex_areas(v, tri)
    stiffness = cotangent_stiffness(v, tri)
    area = np.maximum(area, 1e-2)

    bones = [head.parts[part] for part in ("skull", "mandible")]
    surfaces = [Surface(b.vertices, short_diagonals(b.vertices, b.faces)) for b in bones]
    point, _, distance = zip(*(s.closest(v) for s in surfaces), strict=True)
    nearer = (distance[1] < distance[0]).astype(int)
    row = np.arange(n)
    bone_point, bone_distance = np.stack(point)[nearer, row], np.stack(distance)[nearer, row]
    toward = (bone_point - v) / np.maximum(bone_distance, 1e-6)[:, None]
    facing = -np.einsum("ij,ij->i", toward, normal)
    # the way from a closest point to its surface is along the surface's normal, also at edges between triangles
    bone_normal = -toward

    soft = np.zeros(n)
    depth = np.full(n, _OTHER[0])
    hold, layer, sheet = np.full(n, _OTHER[1]), np.full(n, _OTHER[2]), np.ones(n)
    for name, (d, h, m, e) in _SOFT.items():
        w = np.broadcast_to(_sides(groups, name), (n,))
        soft = np.maximum(soft, w)
        pairs = ((depth, d), (hold, h), (layer, m), (sheet, e))
        depth, hold, layer, sheet = (x + w * (y - x) for x, y in pairs)
    inner, jaw = groups.get("inner", np.zeros(n)), groups.get("jaw", np.zeros(n))
    throat = build_throat(jaw, groups.get("neck", np.zeros(n)), stiffness, area)
    soft, sheet = np.maximum(soft, throat.off), sheet * throat.sheet
    lips = np.flatnonzero(np.maximum(_sides(groups, "lip_upper"), _sides(groups, "lip_lower")) > 0.5)
    if len(lips):  # the vestibule behind the lips goes where they go; the depth of the mouth stays
        deep = np.clip((cKDTree(v[lips]).query(v)[0] - 10) / 15, 0, 1)
        hold = np.where(_sides(groups, "mouth_bag") > 0.5, 0.08 + deep * (hold - 0.08), hold)
    depth = np.where(inner > 0.5, np.minimum(depth, 1.2), depth)
    reach = (bone_distance < _REACH) & (bone_distance > 0.3) & (facing > 0.4) & (inner < 0.5)
    firm = smoothed((reach & (soft < 0.5)).astype(float) * (1 - soft), stiffness, area, 4.0)
    firm = np.clip(firm, 0, 1) * (inner < 0.5)
    bony = reach & (firm > 0.5)

    thick = np.clip(bone_distance, 1.0, _REACH)
    bone_depth = np.minimum(0.55 * thick, 2.5 + 0.08 * thick)
    offset = np.where(bony[:, None], toward * bone_depth[:, None], -normal * depth[:, None])
    offset = smoothed(offset, stiffness, area, 2.0)
    fascia = v + offset
    bone = np.where(bony[:, None], bone_point, v + 2 * offset)

    over_bone = np.clip(parameters.restoration_thickness / thick, 0.35, 1.5)
    factor = firm * over_bone + (1 - firm) * hold
    soften = np.where(bony, firm, layer)
    face = groups.get("face", np.ones(n))
    restoration = parameters.restoration_area * area * smoothed(factor, stiffness, area, 3.0)
    restoration = restoration * (1 + 12 * np.clip(1 - face, 0, 1) ** 2)
    gum, below = attached(head)
    restoration += (gum * ATTACHED + throat.hold) * parameters.restoration_area * area
    jaw = jaw + gum * (below - jaw)
    mandible = np.where(bony, nearer.astype(float), jaw)
    movable = face > 0.02
    for muscle in head.muscles:  # and where muscles of scalp and ears end
        if muscle.name.startswith(("auricularis", "occipitalis")):
            end = muscle.fibres[:, -max(1, muscle.fibres.shape[1] // 2) :].reshape(-1, 3)
            movable |= cKDTree(end).query(v)[0] < 16
    return Layers(
        nodes=np.concatenate([v, fascia, bone]),
        area=area,
        bony=bony,
        mandible=mandible,
        jaw=jaw,
        sink=np.concatenate([throat.sink, throat.sink, np.where(bony, 0.0, throat.sink)]),
        bone_normal=bone_normal,
        restoration=restoration,
        soften=soften,
        sheet=sheet,
        free=np.concatenate([movable, movable]),
    )


def sheet_ties(head: Head, layers: Layers, reach: float = 9.0) -> np.ndarray:
    """(p, 2) pairs of columns, inner skin (mouth bag, lid backs, nostrils) and the outer skin back to back with it."""
    n = len(layers.area)
    inner = np.asarray(head.groups.get("inner", np.zeros(n))) > 0.5
    outer = np.flatnonzero(~inner & layers.free[:n])
    inside = np.flatnonzero(inner & layers.free[:n])
    if not len(outer) or not len(inside):
        return np.zeros((0, 2), int)
    fascia = layers.nodes[n : 2 * n]
    normal = vertex_normals(head.skin.vertices, short_diagonals(head.skin.vertices, head.skin.faces))
    distance, near = cKDTree(fascia[outer]).query(fascia[inside], min(4, len(outer)))
    distance, near = distance.reshape(len(inside), -1), near.reshape(len(inside), -1)
    a = np.repeat(inside, near.shape[1])
    b = outer[near.ravel()]
    across = fascia[b] - fascia[a]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    # back to back through flesh, not face to face across the mouth or from one lip to the other
    through = (np.einsum("ij,ij->i", across, normal[b]) > 0.4) & (np.einsum("ij,ij->i", across, normal[a]) < -0.4)
    together = np.abs(layers.jaw[a] - layers.jaw[b]) < 0.3
    keep = through & together & (distance.ravel() < reach)
    return np.stack([a[keep], b[keep]], axis=1)
