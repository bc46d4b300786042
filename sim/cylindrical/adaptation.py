# SPDX-License-Identifier: GPL-3.0-or-later
"""The generic head adapted to a range map by the ten steps of Lee, Terzopoulos and Waters 1995, section 2.2.

1 nose tip (`nose`), 2 chin tip, 3 mouth contour, 4 chin contour, 5 ears, 6 eyes (`features`), 7 spring forces
(`springs`), 8 hair mesh, 9 body mesh, 10 texture coordinates (here). It is kept as published, for comparison; the head
that is built takes the features found and fits its own way (`sim.adapt.skin_fit`).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import spsolve

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..mesh import Mesh, edges, vertex_normals
from ..mesh_subdivision import drawn
from ..progress import Progress, Work, portion
from .canonical import generic
from .features import VAGUE, Features, find_features, stretched
from .grid_mesh import to_mesh
from .range_map import TURN, RangeMap
from .relaxation import filled
from .springs import relax

#: A node samples the map where the generic head's own map shows it (within mm) and not too steep (sine).
SHOWN, STEEP = 1.5, 0.3
#: mm from where the features alone would put a node beyond which what the map shows there is something else.
ELSE = 18.0
#: Texels from data up to which the relaxed surface of a void is sampled.
VOID = 8
#: Nodes so near to the axis that a cylinder cannot show them, mm.
CROWN = 35.0
#: How a feature that was found for sure is held, against a spring.
HOLD = 25.0


@dataclass(frozen=True, eq=False)
class Adapted:
    """What `adapt` returns, in the scan's place.

    skin : the generic skin's mesh as it is drawn, on the map's surface (mm); ``uv`` places its corners in ``map``
    map : the range map with relaxed voids, whose colours are the texture
    sampled : (n,) bool, vertices that took their place from the map; the others follow their neighbours
    hair, body : (n,) bool, vertices that extend the face to the scalp and the neck
    features : the `Features` it rests on
    error : mm: ``mean``, ``p95``, ``max`` from the face of the skin to the map's own surface, ``landmarks`` (mean distance
        of the skin's landmarks from the features found); ``coverage``: share of the face that has data
    """

    skin: Mesh
    map: RangeMap
    sampled: np.ndarray
    hair: np.ndarray
    body: np.ndarray
    features: Features
    error: dict


def adapt(range_map: RangeMap, reference: Head, features: Features | None = None) -> Work:
    """Work returning the `Adapted` generic head; ``features`` if they have been found already.

    Raises
    ------
    InputError : there is no face in the map.
    """
    if features is None:
        features = yield from portion(find_features(range_map, reference), 0.0, 0.6)
    yield Progress(0.6, "Activating the springs")
    skin = reference.skin.moved(drawn(reference.skin.faces, reference.skin.vertices))
    n = len(skin.vertices)
    maps, pattern = features.maps, generic(reference)
    rows, columns, radius = pattern.full.texels(skin.vertices)
    shown = _shown(reference, skin, pattern, rows, columns, radius)
    unit = np.array([np.median(radius[shown]) * pattern.full.step, pattern.full.rise])
    flat = np.column_stack([columns, rows]) * unit
    links = edges(skin.faces)
    used = np.flatnonzero(shown)
    links = links[shown[links].all(axis=1)]
    index = np.cumsum(shown) - 1
    pins, goal, hold = _pins(reference, features, n)
    pins, kept = _on_nodes(pins, shown)
    # features and nodes count columns from the same seam
    turn = TURN / pattern.full.step
    goal, hold = goal[kept], hold[kept]
    home = pins @ np.column_stack([columns, rows])[used]
    goal[:, 0] = home[:, 0] + np.mod(goal[:, 0] - home[:, 0] + turn / 2, turn) - turn / 2
    at = relax(flat[used], index[links], pins, goal * unit, hold, turn * unit[0]) / unit
    yield Progress(0.7, "Sampling the range map")
    marks = reference.landmark_positions()
    home = np.array([marks[name] for name in features.names])
    places = np.array([features.positions[name] for name in features.names])
    sure = np.array([features.confidence[name] for name in features.names])
    matrix, shift = stretched(features.pose, home, places, sure)
    ahead = skin.vertices @ matrix.T + shift
    found = maps.full.place(at[:, 1], at[:, 0])
    good = np.isfinite(found).all(axis=1) & (np.linalg.norm(found - ahead[used], axis=1) < ELSE)
    good &= _near_data(maps.raw, at)
    sampled = np.zeros(n, dtype=bool)
    sampled[used[good]] = True
    vertices = ahead.copy()
    vertices[used[good]] = found[good]
    yield Progress(0.8, "Extending to hair and body")
    vertices = _followed(skin, ahead, vertices, sampled)
    yield Progress(0.9, "Storing texture coordinates")
    whole = filled(range_map)
    skin = replace(skin.moved(vertices), uv=_texture(whole, skin.faces, vertices), material=None)
    groups = {g: np.asarray(reference.groups[g]) > 0.5 for g in ("scalp", "neck")}
    error = _error(range_map, reference, skin, features)
    return Adapted(skin, whole, sampled, groups["scalp"], groups["neck"], features, error)


def _shown(reference, skin, pattern, rows, columns, radius):
    """(n,) bool: vertices that the generic head's own map shows."""
    own = pattern.raw.sample(rows, columns)
    normal = vertex_normals(skin.vertices, skin.triangles)
    axis = pattern.full.origin + np.outer(
        (skin.vertices - pattern.full.origin) @ pattern.full.axes[2], pattern.full.axes[2]
    )
    out = (skin.vertices - axis) / np.maximum(radius, 1e-6)[:, None]
    with np.errstate(invalid="ignore"):
        near = np.abs(own - radius) < SHOWN
    inner = np.asarray(reference.groups["inner"]) > 0.5
    for ear in ("ear_l", "ear_r"):  # found and held, but too folded for a cylinder to show
        inner |= np.asarray(reference.groups[ear]) > 0.3
    return near & (np.einsum("ij,ij->i", normal, out) > STEEP) & (radius > CROWN) & ~inner


def _near_data(raw: RangeMap, at: np.ndarray) -> np.ndarray:
    """(k,) bool: nodes ``at`` (columns, rows) on data or in a small void; across large ones a surface is mere guess."""
    wide = np.concatenate([raw.valid[:, -VOID:], raw.valid, raw.valid[:, :VOID]], axis=1)
    away = distance_transform_edt(~wide)[:, VOID:-VOID]
    i = np.clip(np.rint(at[:, 1]).astype(int), 0, raw.shape[0] - 1)
    return away[i, np.mod(np.rint(at[:, 0]).astype(int), raw.shape[1])] < VOID


def _pins(reference: Head, features: Features, n: int):
    """The features found as pins: (k, n) sparse rows, their columns and rows in the map (k, 2), how they are held (k,)."""
    marks = reference.landmarks
    told = [k for k, name in enumerate(features.names) if name not in VAGUE and features.confidence[name] > 0.25]
    at = [marks.names.index(features.names[k]) for k in told]
    rows = np.repeat(np.arange(len(at)), 3)
    pins = csr_matrix((marks.weights[at].ravel(), (rows, marks.corners[at].ravel())), shape=(len(at), n))
    goal = np.column_stack([features.columns[told], features.rows[told]])
    return pins, goal, HOLD * np.array([features.confidence[features.names[k]] for k in told])


def _on_nodes(pins: csr_matrix, shown):
    """Pins on the nodes shown only, and which of the pins that leaves."""
    kept = np.asarray(pins[:, shown].sum(axis=1)).ravel() > 0.5
    pins = pins[kept][:, shown]
    share = np.asarray(pins.sum(axis=1)).ravel()
    return (diags(1 / share) @ pins).tocsr(), kept


def _followed(skin: Mesh, ahead, vertices, sampled):
    """Vertices that were not sampled, moved from ``ahead`` (n, 3) as smoothly as their neighbours were."""
    links = edges(skin.faces)
    n = len(ahead)
    i, j = links.T
    link = csr_matrix((np.ones(len(links)), (i, j)), shape=(n, n))
    link = link + link.T
    degree = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)
    smooth = diags(np.ones(n)) - diags(1 / degree) @ link
    energy = (smooth.T @ smooth + 1e-6 * diags(np.ones(n))).tocsr()
    free = np.flatnonzero(~sampled)
    known = np.flatnonzero(sampled)
    if len(free) == 0 or len(known) == 0:
        return vertices
    moved = (vertices - ahead)[known]
    out = vertices.copy()
    out[free] = ahead[free] + spsolve(energy[free][:, free].tocsc(), -(energy[free][:, known] @ moved)).reshape(-1, 3)
    return out


def _texture(whole: RangeMap, faces, vertices):
    """(m, 4, 2) texture coordinates of the faces' corners in the map's picture, unbroken over the seam of each face."""
    rows, columns, _ = whole.texels(vertices)
    h, w = whole.shape
    uv = np.column_stack([(columns + 0.5) / w, 1 - (rows + 0.5) / h])
    corner = uv[np.maximum(faces, 0)]
    if whole.closed:  # a face over the seam goes on past the picture's side, which repeats
        corner[..., 0] += np.rint(corner[:, :1, 0] - corner[..., 0])
    return corner.astype(np.float32)


def _error(range_map, reference, skin, features):
    surface = to_mesh(range_map)
    target = Surface(surface.vertices, surface.triangles)
    face = (np.asarray(reference.groups["face"]) > 0.5) & (np.asarray(reference.groups["inner"]) <= 0.5)
    triangles = skin.triangles[face[skin.triangles].all(axis=1)]
    corners = skin.vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    contact = target.closest(corners.mean(axis=1), 10.0)
    data = contact.found & ~contact.border
    distance, weight = contact.distance[data], area[data]
    order = np.argsort(distance)
    share = np.cumsum(weight[order]) / max(weight.sum(), 1e-12)
    marks = reference.landmarks.on({"skin": skin.vertices})
    off = [np.linalg.norm(marks[n] - features.positions[n]) for n in features.names if n not in VAGUE]
    return {
        "mean": float(np.average(distance, weights=weight)) if len(distance) else None,
        "p95": float(distance[order][np.searchsorted(share, 0.95)]) if len(distance) else None,
        "max": float(distance.max()) if len(distance) else None,
        "coverage": float(weight.sum() / max(area.sum(), 1e-12)),
        "landmarks": float(np.mean(off)),
    }
