# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that is turned, stretched or mirrored keeps its outside, its normals and its places on pictures."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh, vertex_normals


@pytest.fixture
def mixed():
    """A quad and a triangle with places on a picture, and normals."""
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0.5], [0, 1, 0], [3, 2, 1]])
    faces = np.array([[0, 1, 2, 3], [1, 4, 2, -1]], np.int32)
    uv = vertices[np.maximum(faces, 0)][..., :2].astype(np.float32)
    mesh = Mesh(vertices, faces, uv=uv)
    return Mesh(vertices, faces, uv=uv, normals=vertex_normals(vertices, mesh.triangles).astype(np.float32))


MATRICES = [np.diag([1.0, 2, 3]), np.diag([-1.0, 1, 1]), np.array([[0.0, -2, 0], [1, 0, 0.5], [0, 0, -1]])]


@pytest.mark.parametrize("matrix", MATRICES)
def test_outside_stays_outside(mixed, matrix):
    made = mixed.transformed(matrix)
    np.testing.assert_allclose(made.vertices, mixed.vertices @ matrix.T)
    assert (made.faces[:, 3] >= 0).tolist() == [True, False]
    outward = np.linalg.inv(matrix).T  # how planes move
    for one, other in zip(mixed.triangles, made.triangles, strict=True):
        before, after = (
            np.cross(v[t[1]] - v[t[0]], v[t[2]] - v[t[0]]) for v, t in ((mixed.vertices, one), (made.vertices, other))
        )
        assert (outward @ before) @ after > 0
    expected = mixed.normals @ outward.T
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(made.normals, expected, atol=1e-6)


@pytest.mark.parametrize("matrix", MATRICES)
def test_corners_keep_their_places_on_the_picture(mixed, matrix):
    made = mixed.transformed(matrix)
    for faces, uv in zip(made.faces, made.uv, strict=True):
        used = faces >= 0
        np.testing.assert_array_equal(uv[used], mixed.vertices[faces[used], :2].astype(np.float32))
    assert mixed.transformed(np.eye(3)).faces is mixed.faces


def test_a_mesh_of_lists_and_other_numbers_is_one_of_arrays():
    """In float32 it could not be cleaned, and three quads that were taken for four triangles were scrambled without a word."""
    points, quads = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]]
    for mesh in (
        Mesh(points, quads),
        Mesh(np.array(points, np.float32), np.array(quads, np.int64)),
        Mesh(np.ravel(points), np.ravel(quads)),
    ):
        assert (mesh.vertices.dtype, mesh.vertices.shape) == (np.float64, (4, 3))
        assert (mesh.faces.dtype, mesh.faces.shape) == (np.int32, (1, 4))
        np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(Mesh(points, [[0, 1, 2]]).faces, [[0, 1, 2, -1]])
    for bad, word in (
        (lambda: Mesh.from_triangles(points, quads * 3), r"triangles .* shape \(3, 4\): give \(n, 3\)"),
        (lambda: Mesh.from_triangles(np.zeros((5, 2)), [[0, 1, 2]]), "vertices .* shape"),
        (lambda: Mesh(points, [[0, 1, "two", 3]]), "faces .* no table of numbers"),
        (lambda: Mesh(None, quads), "vertices"),
        (lambda: Mesh(points, [[0, 1, 2], [0, 1]]), "faces"),
    ):
        with pytest.raises(InputError, match=word):
            bad()


@pytest.mark.parametrize("index", [2.7, np.nan, 2**32 + 2, 10**30, "x"])
def test_faces_of_parts_of_vertices_are_refused(index):
    """2.7 was taken for the vertex 2, and so was 2^32 + 2, without a word."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    for make, faces in ((Mesh, [[0, 1, index, 3]]), (Mesh, [[0, 1, index]]), (Mesh.from_triangles, [[0, 1, index]])):
        with pytest.raises(InputError, match="(faces|triangles) of a mesh are no"):
            make(points, faces)
    whole = Mesh(points, [[0.0, 1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(whole.faces, [[0, 1, 2, 3]])
