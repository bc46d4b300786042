# SPDX-License-Identifier: GPL-3.0-or-later
"""The head's muscles, painted as grids of fibres, as the arrays of `Fibres` and `Axes` (Kähler et al. 2002, section 3)."""

import numpy as np
from scipy.spatial import cKDTree

from ...anatomy.head import Head, Muscle
from ...anatomy.muscle_room import both_ways
from ...errors import InputError
from ...mesh import vertex_normals
from ..muscle_field import JAW_MUSCLES, LID_MUSCLES, base_name
from .calibration import GAINS, MOST, USUAL
from .fibres import arc_lengths
from .merged import free_ends, interlaced, numbered, shared
from .parameters import Parameters
from .structures import Axes, Fibres

#: Share of its radius by which the centre of a ring lies toward its medial end, which is fixed to the orbit's rim.
_MEDIAL = 0.55
_LIP = ("lip_upper", "lip_lower")


def movers(head: Head, table: dict) -> list[int]:
    """Indices of the muscles that move skin: not those that work the jaw or turn a lid."""
    return [
        k
        for k, m in enumerate(head.muscles)
        if base_name(m.name) not in JAW_MUSCLES + LID_MUSCLES
        and table.get(base_name(m.name), {}).get("excursion_mm", 4.0) > 0
    ]


def build_muscles(head: Head, parameters: Parameters, table: dict) -> tuple[Fibres, Axes]:
    """All muscles that move skin. ``table``: base name -> {"excursion_mm"}, how far the skin goes at contraction 1.

    Raises
    ------
    InputError : the head has none.
    """
    rows = movers(head, table)
    if not rows:
        raise InputError("The head has no muscle that moves skin: build it again from its scan.")
    muscles = [head.muscles[k] for k in rows]
    around = _Surroundings(head)
    axes = _build_axes(muscles, rows, around, parameters, table)
    return _build_fibres(muscles, around), axes


class _Surroundings:
    """Normals and jaw shares of the seen skin over points of muscles."""

    def __init__(self, head: Head):
        v = head.skin.vertices
        zero = np.zeros(len(v))
        self.normals = vertex_normals(v, both_ways(head.skin.faces))
        self.jaw = np.asarray(head.groups.get("jaw", zero), float)
        self.seen = np.asarray(head.groups.get("inner", zero)) < 0.5
        self.lips = [np.asarray(head.groups.get(name, zero)) > 0.3 for name in _LIP]
        self.vertices = v

    def at(self, muscle: Muscle, points):
        """Outward unit normals (..., 3) and shares (...) with the mandible at points (..., 3) of a muscle."""
        keep = self.seen.copy()
        if muscle.kind == "sphincter" and not muscle.ring:  # an arc belongs to one lip, however near the other is
            keep &= ~self.lips[int("upper" in muscle.name)]
        index = np.flatnonzero(keep)
        near = index[cKDTree(self.vertices[index]).query(points)[1]]
        share = self.jaw[near]
        if muscle.kind != "sphincter":
            along = np.linspace(0, 1, points.shape[-2])
            root = {"skull": 0.0, "mandible": 1.0}.get(muscle.origin)
            if root is not None:
                share = root + along * (share[..., -1:] - root)
        return self.normals[near], share


def _build_fibres(muscles: list[Muscle], around: _Surroundings) -> Fibres:
    parts = {
        name: [] for name in ("points", "fibre", "muscle", "station", "start", "share", "normal", "thickness", "belly")
    }
    fibre, station = 0, 0
    for k, muscle in enumerate(muscles):
        count, length = muscle.fibres.shape[:2]
        normal, share = around.at(muscle, muscle.fibres)
        along = np.linspace(0, 1, length)
        belly = np.ones(length) if muscle.kind == "sphincter" else np.sqrt(np.sin(np.pi * along).clip(0))
        parts["points"].append(muscle.fibres.reshape(-1, 3))
        parts["fibre"].append(fibre + np.repeat(np.arange(count), length))
        parts["muscle"].append(np.full(count * length, k))
        parts["station"].append(station + np.tile(np.arange(length), count))
        parts["start"].append(np.tile(np.arange(length) == 0, count))
        parts["share"].append(share.ravel())
        parts["normal"].append(normal.reshape(-1, 3))
        parts["thickness"].append(np.full(count * length, muscle.thickness))
        parts["belly"].append(np.tile(belly, count))
        fibre, station = fibre + count, station + length
    joined = {name: np.concatenate(part) if part else np.zeros(0) for name, part in parts.items()}
    return Fibres(along=arc_lengths(joined["points"], joined["start"]), **joined)


def _build_axes(muscles: list[Muscle], rows, around: _Surroundings, p: Parameters, table: dict) -> Axes:
    paths = [m.path for m in muscles]
    size = np.array([len(x) for x in paths], int)
    begin = np.concatenate([[0], np.cumsum(size)[:-1]])
    stations, owner = np.concatenate(paths), np.repeat(np.arange(len(muscles)), size)
    start = np.zeros(len(stations), bool)
    start[begin] = True
    along = arc_lengths(stations, start)
    total = along[begin + size - 1]
    normal, share = (np.concatenate(x) for x in zip(*(around.at(m, m.path) for m in muscles), strict=True))
    ring = np.array([m.ring for m in muscles])
    circular = np.array([m.kind == "sphincter" for m in muscles])
    centre = np.array([_centre(m) for m in muscles])
    outward = np.array([normal[b : b + s].mean(axis=0) for b, s in zip(begin, size, strict=True)])
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)

    # chains along each axis, rings closed
    inside = np.flatnonzero(~start)
    first = np.concatenate([inside - 1, (begin + size - 1)[ring]])
    second = np.concatenate([inside, begin[ring]])
    section = np.array([m.width * m.thickness for m in muscles])
    spring_owner = owner[second]
    stiffness = p.fibre * section[spring_owner]
    each = np.maximum(np.gradient(along), 0.5)
    each[begin], each[begin + size - 1] = (0.5 * each[i] for i in (begin + 1, begin + size - 2))

    # common nodes of merged muscles, ties where they only share some fibres
    end_owner, tip = free_ends(muscles)
    end = np.where(tip > 0, (begin + size - 1)[end_owner], begin[end_owner])
    pairs = shared(muscles, end_owner, tip)
    apart = np.linalg.norm(stations[end[pairs[:, 0]]] - stations[end[pairs[:, 1]]], axis=1)
    free = ~start | circular[owner]
    into = interlaced(muscles, begin, end_owner, tip, p.interlace)
    node = numbered(np.concatenate([end[pairs[apart <= p.merge]], into]), free)
    tie = end[pairs[apart > p.merge]]
    share = _evened(share, node)
    first, second = np.concatenate([first, tie[:, 0]]), np.concatenate([second, tie[:, 1]])
    stiffness = np.concatenate([stiffness, p.fibre * np.minimum(*section[owner[tie]].T) if len(tie) else []])
    spring_owner = np.concatenate([spring_owner, np.full(len(tie), -1)])
    rest = np.maximum(np.linalg.norm(stations[second] - stations[first], axis=1), 0.2)
    return Axes(
        muscles=np.array(rows),
        round=circular,
        flat=ring,
        centre=centre,
        line=outward,
        lip=np.array([_lip(m) for m in muscles]),
        slide=np.where(circular & ~ring, p.protrusion, 0.0),
        shortening=_shortening(muscles, centre, total, table),
        stations=stations,
        muscle=owner,
        along=along,
        total=total,
        share=share,
        normal=normal,
        node=node,
        bed=p.bed * each * np.array([m.width for m in muscles])[owner],
        first=first,
        second=second,
        owner=spring_owner.astype(int),
        rest=rest,
        stiffness=stiffness,
    )


def _lip(muscle: Muscle) -> int:
    """0 in the upper lip, 1 in the lower, -1 elsewhere."""
    arc = muscle.kind == "sphincter" and not muscle.ring
    return int("upper" not in muscle.name) if arc else -1


def _centre(muscle: Muscle) -> np.ndarray:
    """(3,) where a sphincter draws together; for others the middle of the path, which nothing reads."""
    middle = muscle.path.mean(axis=0)
    if not muscle.ring:
        return middle if muscle.centre is None else muscle.centre
    centre = middle if muscle.centre is None else muscle.centre
    medial = muscle.path[np.argmin(np.abs(muscle.path[:, 0]))]
    return centre + _MEDIAL * (medial - centre)


def _shortening(muscles, centre, total, table) -> np.ndarray:
    """(m,) share of its length (or radius) that each muscle loses at full contraction; anatomy sets the limit."""
    out = np.zeros(len(muscles))
    for k, muscle in enumerate(muscles):
        base = base_name(muscle.name)
        way = float(table.get(base, {}).get("excursion_mm", 4.0)) * GAINS.get(base, USUAL)
        length = total[k]
        if muscle.kind == "sphincter":
            radius = np.linalg.norm(muscle.path - centre[k], axis=1)
            length = radius.max() if not muscle.ring else radius.mean()
        out[k] = min(MOST * muscle.max_shortening, way / max(length, 1.0))
    return out


def _evened(share, node) -> np.ndarray:
    """(s,) shares with the mandible, one for all stations of a common node."""
    held = node >= 0
    count = np.bincount(node[held])
    mean = np.bincount(node[held], share[held]) / np.maximum(count, 1)
    out = share.copy()
    out[held] = mean[node[held]]
    return out
