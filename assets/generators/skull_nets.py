# SPDX-License-Identifier: GPL-3.0-or-later
"""From a distance field to a closed mesh of quads: surface nets on a grid that is fine in the face and coarse behind.

One vertex per grid cell that the surface crosses, one quad per crossed grid edge (Gibson 1998); afterwards the vertices
relax along the surface and are drawn back onto it. The field is symmetric in x and the grid has cells centred on
x = 0, so the mesh is its own mirror image and has vertices on the midline.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh, edges, vertex_normals

_CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def surface_nets(field, low, high, cell, fine=None, growth=12.0, rounds=6) -> Mesh:
    """The zero surface of ``field`` as a closed, symmetric mesh of quads, facing outward.

    Parameters
    ----------
    field : function of points (n, 3) mm with x >= 0 -> (n,) mm, negative inside
    low, high : (3,) mm, box that holds the surface
    cell : mm, size of a cell
    fine : ((low, high) of y, (low, high) of z) mm: outside this band cells grow along that axis, by a factor e
        each ``growth`` cells; None: nowhere
    rounds : relaxation rounds
    """
    axes = _axes(np.asarray(low, float), np.asarray(high, float), cell, fine, growth)
    shape = tuple(len(a) for a in axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    half = shape[0] // 2
    value = field(grid[half:].reshape(-1, 3)).reshape(half, *shape[1:])
    value = np.concatenate([value[::-1], value])
    value = _without_ambiguity(np.where(np.abs(value) < 1e-6, -1e-6, value))
    faces, vertices = _quads(value, grid)
    return _relaxed(_largest(Mesh(vertices, faces)), field, cell, rounds)


def _axes(low, high, cell, fine, growth):
    """Grid planes of each axis; those of x are odd multiples of half a cell."""
    half = (np.arange(int(np.ceil(high[0] / cell)) + 1) + 0.5) * cell
    axes = [np.concatenate([-half[::-1], half])]
    for axis in (1, 2):
        start, stop = (low[axis] - cell, high[axis] + cell) if fine is None else fine[axis - 1]
        planes = list(np.arange(start, stop + cell, cell))
        step = cell
        while planes[-1] < high[axis] + cell:
            step *= np.exp(1 / growth)
            planes.append(planes[-1] + step)
        step = cell
        while planes[0] > low[axis] - cell:
            step *= np.exp(1 / growth)
            planes.insert(0, planes[0] - step)
        axes.append(np.array(planes))
    return axes


def _without_ambiguity(value):
    """Fill cells where two sheets of the surface would share a vertex or an edge: the mesh is then a manifold."""
    table = _ambiguous_cells()
    for _ in range(20):
        inside = value < 0
        code = sum(inside[_corner(c, value.shape)].astype(int) << n for n, c in enumerate(_CORNERS))
        bad = table[code]
        if not bad.any():
            return value
        where = np.zeros(value.shape, bool)
        for c in _CORNERS:
            where[_corner(c, value.shape)] |= bad
        value = np.where(where & ~inside, -0.2, value)
    raise ArithmeticError("the bone's field is too ragged for this cell size")


def _corner(c, shape):
    return tuple(slice(c[a], shape[a] - 1 + c[a]) for a in range(3))


def _ambiguous_cells():
    """(256,) bool: corner patterns whose inside or outside falls apart, or with a checkerboard face."""
    near = np.abs(_CORNERS[:, None] - _CORNERS[None]).sum(-1) == 1
    bad = np.zeros(256, bool)
    for code in range(256):
        inside = (code >> np.arange(8) & 1).astype(bool)
        for side in (inside, ~inside):
            if side.any() and connected_components(coo_matrix(near[np.ix_(side, side)]))[0] > 1:
                bad[code] = True
        for axis in range(3):
            for level in (0, 1):
                on = _CORNERS[:, axis] == level
                a, b, c, d = inside[on]  # order 00 01 10 11
                bad[code] |= a == d and b == c and a != b
    return bad


def _quads(value, grid):
    """Faces (m, 4), and the mean edge crossing of each cell as first vertex positions (n, 3)."""
    shape = np.array(value.shape) - 1
    total = np.zeros((*shape, 3))
    count = np.zeros(shape)
    loops = []
    for axis in range(3):
        first = [slice(None)] * 3
        second = [slice(None)] * 3
        first[axis], second[axis] = slice(0, -1), slice(1, None)
        a, b = value[tuple(first)], value[tuple(second)]
        at = np.argwhere((a < 0) != (b < 0))
        va, vb = a[tuple(at.T)], b[tuple(at.T)]
        step = np.eye(3, dtype=int)[axis]
        pa, pb = grid[tuple(at.T)], grid[tuple((at + step).T)]
        cross = pa + (va / (va - vb))[:, None] * (pb - pa)
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        ring = [at - u - v, at - v, at, at - u]
        for cell in ring:
            np.add.at(total, tuple(cell.T), cross)
            np.add.at(count, tuple(cell.T), 1)
        index = np.stack([np.ravel_multi_index(tuple(c.T), shape) for c in ring], axis=1)
        index[va > vb] = index[va > vb][:, ::-1]
        loops.append(index)
    faces = np.concatenate(loops)
    used, faces = np.unique(faces, return_inverse=True)
    vertices = total.reshape(-1, 3)[used] / count.reshape(-1, 1)[used]
    return faces.reshape(-1, 4).astype(np.int32), vertices


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
            vertices[left] += _towards_surface(field, vertices[left], cell / 3)
            vertices[mirror[left]] = vertices[left] * [-1, 1, 1]
            vertices[left[mirror[left] == left], 0] = 0.0
    return mesh.moved(vertices)


def _towards_surface(field, points, limit, step=0.4):
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
