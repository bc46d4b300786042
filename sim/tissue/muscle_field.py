# SPDX-License-Identifier: GPL-3.0-or-later
"""Where muscles pull: linear and piecewise-linear fibres on fascia nodes (Lee, Terzopoulos and Waters 1995, 3.4, 3.5).

Every fibre of a muscle is a chain of segments; a linear muscle is a chain of one direction. For a fascia node the
length ratio epsilon is how far along the fibre it lies (0 at the root, 1 at the free end) and the width omega how far
beside it, depth not counted. The force is Theta_1(epsilon) Theta_2(omega / width) along the fibre toward its root. A
sphincter (3.5, orbicularis) pulls along its ring and so tightens toward its centre and lifts off what it encloses.
"""

import numpy as np

from ..anatomy.head import Head, Muscle
from ..mesh import vertex_normals
from .geometry import short_diagonals
from .structures import Layers, MuscleField

#: Muscles that move the mandible and no skin; `acting.pose` turns them into jaw motion.
JAW_MUSCLES = ("masseter", "temporalis", "pterygoideus_medialis", "pterygoideus_lateralis", "digastricus")
#: Muscles whose work `lids` does as a turn of the lid over the eyeball.
LID_MUSCLES = ("levator_palpebrae", "orbicularis_oculi_palpebral", "orbicularis_oculi_lacrimal")
#: The two muscles that the orbicularis oris is divided into, each with a centre of contraction that moves on a line.
LIPS = ("orbicularis_oris_upper", "orbicularis_oris_lower")
FORWARD = np.array([[0.0, -1.0, 0.0]])
#: Muscles that meet in the modiolus, beside the corner of the mouth, and go on from there into the skin of both lips (Standring
#: 2015, Gray's Anatomy: their slips interlace with orbicularis oris).
MODIOLUS = ("zygomaticus_major", "risorius", "levator_anguli_oris", "depressor_anguli_oris", "buccinator")
#: Share at which the way beyond their free end counts: their pull reaches the corner.
_BEYOND = 0.35
_LIDS = ("upper_l", "upper_r", "lower_l", "lower_r")
#: Half the width over which a single fibre takes hold of the fascia, mm: about one mesh of the skin and a half.
_NARROWEST = 7.5
_DEPTH = 16.0  # mm between a fibre and the fascia it may still move


def base_name(name: str) -> str:
    """``zygomaticus_major_l`` -> ``zygomaticus_major``."""
    return name[:-2] if name.endswith(("_l", "_r")) else name


def theta_1(epsilon):
    """Length factor of 3.4, figure 8(a): 0 at the root in the bone, 1 near the free end, fading beyond it."""
    e = np.clip(epsilon, 0, 1)
    rise = np.sin(0.5 * np.pi * e) ** 2
    return np.where(np.asarray(epsilon) <= 0, 0.0, rise)


def theta_2(ratio):
    """Width factor of 3.4, figure 8(b): 1 on the fibre, smoothly 0 at and beyond the width (ratio 1)."""
    r = np.clip(np.abs(ratio), 0, 1)
    return np.cos(0.5 * np.pi * r) ** 2


def fibre_coordinates(points, normals, fibre, closed=False):
    """Length ratio (k,), width (k,), depth (k,) and the direction (k, 3) toward the root, of ``points`` (k, 3).

    fibre (p, 3); 3.5's sum over the remaining segments is the arc length. Beyond the free end the width grows.
    """
    chain = np.concatenate([fibre, fibre[:1]]) if closed else fibre
    a, b = chain[:-1], chain[1:]
    segment = b - a
    length = np.maximum(np.linalg.norm(segment, axis=1), 1e-9)
    start = np.concatenate([[0], np.cumsum(length)[:-1]])
    rel = points[:, None] - a[None]
    t = np.clip(np.einsum("ksj,sj->ks", rel, segment) / length**2, 0, 1)
    away = rel - t[..., None] * segment[None]
    deep = np.einsum("ksj,kj->ks", away, normals)
    side = np.linalg.norm(away - deep[..., None] * normals[:, None], axis=2)
    # rounded: beside a joint both segments are equally near, and a muscle and its mirror image are to choose the same
    best = np.argmin(np.round(side**2 + 0.25 * deep**2, 9), axis=1)
    row = np.arange(len(points))
    along = start[best] + t[row, best] * length[best]
    direction = -(segment / length[:, None])[best]
    return along / length.sum(), side[row, best], deep[row, best], direction


def _linear(muscle: Muscle, points, normals):
    weight = np.zeros(len(points))
    direction = np.zeros((len(points), 3))
    fibres = muscle.fibres
    spacing = muscle.width / max(len(fibres), 1)
    for fibre in fibres:
        epsilon, omega, deep, toward = fibre_coordinates(points, normals, fibre)
        reach = max(spacing, _NARROWEST) + 0.5 * _NARROWEST
        if base_name(muscle.name) in MODIOLUS:
            omega = np.where(epsilon < 1, omega, _BEYOND * omega)
        w = theta_1(epsilon) * theta_2(omega / reach) * (np.abs(deep) < _DEPTH)
        weight = np.maximum(weight, w)
        direction += w[:, None] * toward
    return weight, direction


def _ring(muscle: Muscle, points, normals):
    """A closed ring round the eye: pulls toward its centre, and all of it toward its fixed medial end."""
    centre = muscle.centre if muscle.centre is not None else muscle.path.mean(axis=0)
    weight = np.zeros(len(points))
    for fibre in muscle.fibres:
        _, omega, deep, _ = fibre_coordinates(points, normals, fibre, closed=True)
        weight = np.maximum(weight, theta_2(omega / max(muscle.width, 8.0)) * (np.abs(deep) < _DEPTH))
    inward = centre - points
    inward -= np.einsum("ij,ij->i", inward, normals)[:, None] * normals
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
    # the ring is fixed at its medial end: nothing moves there, most moves below and outside (the raised cheek)
    medial = np.array([-np.sign(centre[0]), 0.0, 0.0])
    relative = points - centre
    relative /= np.maximum(np.linalg.norm(relative, axis=1, keepdims=True), 1e-9)
    fixed = np.clip(relative @ medial, 0, 1)
    above = np.clip(relative[:, 2], 0, 1)
    weight = weight * (1 - 0.8 * fixed) * (1 - 0.65 * above)
    return weight, inward + 0.25 * medial


def _arc(muscle: Muscle, points, normals):
    """An arc of the orbicularis oris: both halves pull along the lip to the middle, which moves forward (5)."""
    centre = muscle.centre if muscle.centre is not None else muscle.path.mean(axis=0)
    weight = np.zeros(len(points))
    for fibre in muscle.fibres:
        _, omega, deep, _ = fibre_coordinates(points, normals, fibre)
        weight = np.maximum(weight, theta_2(omega / max(0.8 * muscle.width, 7.0)) * (np.abs(deep) < _DEPTH))
    half = max(np.abs(muscle.path[:, 0] - muscle.path[:, 0].mean()).max(), 1.0)
    inward = centre - points
    across = inward[:, 0] / half
    direction = np.zeros_like(points)
    direction[:, 0] = np.sign(across) * np.clip(np.abs(across), 0, 1)
    # towards the line between the lips, which contact keeps apart
    direction[:, 2] = 0.45 * np.sign(inward[:, 2]) * np.clip(np.abs(inward[:, 2]) / 4, 0, 1)
    direction[:, 1] = -0.75 * (1 - 0.6 * np.clip(np.abs(across), 0, 1) ** 2)  # forward
    return weight, direction


def build_muscle_field(head: Head, layers: Layers, table: dict) -> MuscleField:
    """Entries of every muscle of ``head``. ``table``: as `model.strengths`."""
    n = len(layers.area)
    fascia = layers.nodes[n : 2 * n]
    usable = np.flatnonzero(layers.free[:n])
    normals = vertex_normals(head.skin.vertices, short_diagonals(head.skin.vertices, head.skin.faces))[usable]
    # lids are turned over the eyeball by `lids`; the eye sockets behind them have no muscle
    lid = np.max([np.asarray(head.groups.get(f"lid_{k}", np.zeros(n))) for k in _LIDS], axis=0)
    socket = np.asarray(head.groups.get("inner", np.zeros(n))) - np.asarray(head.groups.get("mouth_bag", np.zeros(n)))
    spare = (np.clip(1 - lid, 0, 1) ** 2 * (socket < 0.5))[usable]
    owner, column, weight, direction, tie, lip, forward = [], [], [], [], [], [], []
    reach, excursion = [], []
    for k, muscle in enumerate(head.muscles):
        base = base_name(muscle.name)
        row = table.get(base, {})
        moves = base not in JAW_MUSCLES and base not in LID_MUSCLES
        goal = float(row.get("excursion_mm", 4.0)) if moves else 0.0
        length = float(np.linalg.norm(np.diff(muscle.path, axis=0), axis=1).sum())
        excursion.append(goal)
        reach.append(np.clip(muscle.max_shortening * length, 1.8 * goal, 3.0 * goal) if goal else 1.0)
        if not moves:
            continue
        if muscle.ring:
            w, d = _ring(muscle, fascia[usable], normals)
        elif muscle.kind == "sphincter":
            w, d = _arc(muscle, fascia[usable], normals)
        else:
            w, d = _linear(muscle, fascia[usable], normals)
        w = w * spare
        keep = w > 0.02
        # 3.7: what would press fascia into the bone under it is cancelled; it slides
        pressing = np.minimum(np.einsum("ij,ij->i", d, layers.bone_normal[usable]), 0) * layers.bony[usable]
        d = d - pressing[:, None] * layers.bone_normal[usable]
        size = np.linalg.norm(d, axis=1, keepdims=True)
        unit = d / np.maximum(size, 1e-9)
        if muscle.kind == "sphincter" and not muscle.ring:
            w = w * np.minimum(size[:, 0], 1.0)
        owner.append(np.full(int(keep.sum()), k))
        column.append(usable[keep])
        weight.append(w[keep] * layers.area[usable[keep]])
        direction.append(unit[keep])
        tie.append(np.full(int(keep.sum()), 1.0 if muscle.origin == "mandible" else 0.0))
        lip.append(np.full(int(keep.sum()), LIPS.index(base) if base in LIPS else -1))
        forward.append(-np.minimum(unit[keep, 1:2], 0) * FORWARD * (base in LIPS))
    joined = [np.concatenate(x) if x else np.zeros(0, int) for x in (owner, column, weight, direction, tie)]
    return MuscleField(
        tuple(m.name for m in head.muscles),
        *joined,
        strength=np.zeros(len(head.muscles)),
        reach=np.array(reach, float),
        excursion=np.array(excursion, float),
        lip=np.concatenate(lip) if lip else np.zeros(0, int),
        forward=np.concatenate(forward) if forward else np.zeros((0, 3)),
    )


def turned_lips(field: MuscleField, entries, direction, lips) -> np.ndarray:
    """``direction`` (e, 3) of ``entries`` (e,) with the centres of contraction of both lips moved to ``lips`` (2,).

    "The center of contraction for each of these can be translated along a line" (Kähler et al. 2002, section 3): the
    fibres pull towards it, and so push the lip out, or draw it against the teeth.
    """
    lip = field.lip[entries]
    moved = np.append(np.asarray(lips, float), 0.0)[lip]
    moved = np.where(moved < 0, 2 * moved, moved)  # behind the lip by as much as it lies in front of it at 0
    turned = direction + moved[:, None] * field.forward[entries]
    return turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-9)
