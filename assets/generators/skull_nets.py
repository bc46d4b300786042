# SPDX-License-Identifier: GPL-3.0-or-later
"""From a distance field to a closed mesh of quads: surface nets on an even grid.

One vertex per sheet of the surface in a grid cell, one quad per crossed grid edge (Gibson 1998); afterwards the vertices
relax along the surface and are drawn back onto it. The field is symmetric in x and the grid has cells centred on
x = 0, so the mesh is its own mirror image and has vertices on the midline.
"""

from functools import cache

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh, edges, vertex_normals

_CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def surface_nets(field, low, high, cell, rounds=4, finer=None) -> Mesh:
    """The zero surface of ``field`` as a closed, symmetric mesh of quads, facing outward.

    Parameters
    ----------
    field : function of points (n, 3) mm with x >= 0 -> (n,) mm, negative inside
    low, high : (3,) mm, box that holds the surface
    cell : mm, size of a cell
    rounds : relaxation rounds
    finer : (3, 3) for each axis where cells are smaller, from and to, and their size, mm (None: nowhere)
    """
    low = [0.0, *low[1:]]
    spans = [(0.0, 0.0, cell)] * 3 if finer is None else finer
    axes = [_ticks(a, b + cell, cell, *span) for a, b, span in zip(low, high, spans, strict=True)]
    axes[0] = axes[0][:-1] + 0.5 * np.diff(axes[0])
    axes[0] = np.concatenate([-axes[0][::-1], axes[0]])
    shape = tuple(len(a) for a in axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    half = shape[0] // 2
    value = _sampled(field, grid[half:], cell)
    value = np.concatenate([value[::-1], value])
    value = np.where(np.abs(value) < 1e-6, -1e-6, value)
    for _ in range(12):
        faces, vertices, cells = _quads(value, grid)
        pinched = _pinched(faces)
        if not len(pinched):
            break
        # Two sheets meet along an edge: fill their cells, on both sides alike.
        for spot in np.unique(cells[pinched], axis=0):
            for one in (spot, [shape[0] - 2 - spot[0], spot[1], spot[2]]):
                corners = tuple((one + _CORNERS).T)
                value[corners] = np.where(value[corners] < 0, value[corners], -0.3)
    return _relaxed(_largest(Mesh(vertices, faces)), field, cell, rounds)


def _ticks(low, high, cell, start, end, size):
    """Places from ``low`` to ``high`` or beyond, ``cell`` apart, between ``start`` and ``end`` about ``size``."""
    start, end = max(start, low), max(end, low)
    before = np.linspace(low, start, max(int(np.ceil((start - low) / cell)), 1) + 1)[: None if start > low else 1]
    within = np.linspace(start, end, max(int(np.ceil((end - start) / size)), 1) + 1)[1:] if end > start else []
    return np.concatenate([before, within, np.arange(end + cell, high + cell, cell)])


def _sampled(field, grid, cell, stride=3):
    """Values of ``field`` on a grid (a, b, c, 3): true near the surface, elsewhere those of a coarser grid."""
    shape = grid.shape[:3]
    at = [np.unique(np.r_[np.arange(0, n, stride), n - 1]) for n in shape]
    coarse = grid[np.ix_(*at)]
    value = field(coarse.reshape(-1, 3)).reshape(coarse.shape[:3])
    nearest = [np.abs(np.arange(n)[:, None] - a[None]).argmin(axis=1) for n, a in zip(shape, at, strict=True)]
    index = np.ix_(*nearest)
    full = value[index]
    near = np.abs(full) < 1.2 * np.linalg.norm(grid - coarse[index], axis=-1) + 1.8 * cell
    full[near] = field(grid[near])
    return full


def _quads(value, grid):
    """Faces (m, 4), first vertex positions (n, 3), the mean of the edge crossings of a sheet, and cells (n, 3).

    A cell that several sheets cross has a vertex for each (dual marching cubes, Nielson 2004).
    """
    shape = np.array(value.shape) - 1
    inside = value < 0
    code = sum(inside[_corner(c, value.shape)].astype(int) << n for n, c in enumerate(_CORNERS))
    sheet_of = _sheets()
    loops, crossings = [], []
    for axis in range(3):
        first = tuple(slice(0, -1) if a == axis else slice(None) for a in range(3))
        second = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
        at = np.argwhere(inside[first] != inside[second])
        step, u, v = (np.eye(3, dtype=int)[(axis + k) % 3] for k in range(3))
        va, vb = value[tuple(at.T)], value[tuple((at + step).T)]
        pa, pb = grid[tuple(at.T)], grid[tuple((at + step).T)]
        ring = []
        for a, b in ((1, 1), (0, 1), (0, 0), (1, 0)):  # the four cells round the edge
            cell = at - a * u - b * v
            sheet = sheet_of[code[tuple(cell.T)], axis * 4 + a * 2 + b]
            ring.append(np.ravel_multi_index(tuple(cell.T), shape) * 4 + sheet)
        index = np.stack(ring, axis=1)
        index[va > vb] = index[va > vb][:, ::-1]
        loops.append(index)
        crossings.append(pa + (va / (va - vb))[:, None] * (pb - pa))
    faces = np.concatenate(loops)
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 4)
    point = np.repeat(np.concatenate(crossings), 4, axis=0)
    count = np.bincount(faces.ravel(), minlength=len(used))
    total = np.stack([np.bincount(faces.ravel(), p, minlength=len(used)) for p in point.T], axis=1)
    cells = np.stack(np.unravel_index(used // 4, shape), axis=1)
    return faces.astype(np.int32), total / count[:, None], cells


def _pinched(faces):
    """Vertices of edges that more than two faces share."""
    pairs = np.sort(np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    pairs, count = np.unique(pairs, axis=0, return_counts=True)
    return np.unique(pairs[count > 2])


def _corner(c, shape):
    return tuple(slice(c[a], shape[a] - 1 + c[a]) for a in range(3))


@cache
def _sheets():
    """(256, 12) for each pattern of corners inside: the number of the sheet that crosses each edge of the cell.

    Edge ``axis * 4 + a * 2 + b`` runs along ``axis`` at offsets a, b in the two axes that follow it. On a face with
    four crossings the inside corners are kept apart, as its other cell will do.
    """
    ends = []
    for axis in range(3):
        for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
            low = np.zeros(3, int)
            low[(axis + 1) % 3], low[(axis + 2) % 3] = a, b
            ends.append(
                [int(np.flatnonzero((low + k * np.eye(3, dtype=int)[axis] == _CORNERS).all(1))[0]) for k in (0, 1)]
            )
    ends = np.array(ends)
    faces = [np.flatnonzero(_CORNERS[:, axis] == level) for axis in range(3) for level in (0, 1)]
    out = np.zeros((256, 12), int)
    for pattern in range(256):
        inside = (pattern >> np.arange(8) & 1).astype(bool)
        crossed = inside[ends[:, 0]] != inside[ends[:, 1]]
        link = np.zeros((12, 12), bool)
        for face in faces:
            on = np.flatnonzero(crossed & np.isin(ends, face).all(axis=1))
            if len(on) == 2:
                link[on[0], on[1]] = True
            for corner in face[inside[face]] if len(on) == 4 else ():
                first, second = on[(ends[on] == corner).any(axis=1)]
                link[first, second] = True
        label = connected_components(coo_matrix(link), directed=False)[1]
        names = np.unique(label[crossed])
        out[pattern, crossed] = np.searchsorted(names, label[crossed])
    return out


def _largest(mesh):
    """The biggest connected piece, without unused vertices."""
    e = edges(mesh.faces)
    n = len(mesh.vertices)
    label = connected_components(coo_matrix((np.ones(len(e)), (e[:, 0], e[:, 1])), shape=(n, n)), directed=False)[1]
    keep = label == np.bincount(label).argmax()
    new = np.cumsum(keep) - 1
    return Mesh(mesh.vertices[keep], new[mesh.faces[keep[mesh.faces[:, 0]]]].astype(np.int32))


def _relaxed(mesh, field, cell, rounds):
    """Even out the quads along the surface, then lie exactly on it."""
    vertices = mesh.vertices
    e = edges(mesh.faces)
    n = len(vertices)
    link = coo_matrix((np.ones(2 * len(e)), (np.r_[e[:, 0], e[:, 1]], np.r_[e[:, 1], e[:, 0]])), shape=(n, n)).tocsr()
    degree = np.asarray(link.sum(axis=1))
    mirror = mirror_index(vertices)
    left = np.flatnonzero(vertices[:, 0] > -1e-6)
    for turn in range(rounds + 1):
        if turn < rounds:
            step = link @ vertices / degree - vertices
            normal = vertex_normals(vertices, mesh.triangles)
            step -= (step * normal).sum(1, keepdims=True) * normal
            vertices = vertices + 0.5 * step
        for _ in range(1 if turn < rounds else 2):
            vertices[left] += towards_surface(field, vertices[left], cell / 3)
            vertices[mirror[left]] = vertices[left] * [-1, 1, 1]
            vertices[left[mirror[left] == left], 0] = 0.0
    return mesh.moved(vertices)


def towards_surface(field, points, limit, step=0.4):
    """(n, 3) one Newton step along the field's slope, at most ``limit`` mm."""
    value = field(points)
    slope = np.stack([(field(points + step * axis) - value) / step for axis in np.eye(3)], axis=1)
    return -(np.clip(value, -limit, limit) / np.maximum((slope**2).sum(1), 0.25))[:, None] * slope


def mirror_index(vertices):
    """(n,) index of each vertex's mirror image in x."""
    return cKDTree(vertices).query(vertices * [-1, 1, 1])[1]


def symmetric(vertices, mirror):
    """(n, 3) vertices averaged with their mirror images."""
    return (vertices + vertices[mirror] * [-1, 1, 1]) / 2
