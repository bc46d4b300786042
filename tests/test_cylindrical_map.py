# SPDX-License-Identifier: GPL-3.0-or-later
"""Cylindrical range maps of meshes, and meshes of maps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.cylindrical.grid_mesh import to_mesh
from headshop.sim.cylindrical.range_map import resample
from headshop.sim.cylindrical.unroll import unrolled
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.scan.ply import read_ply


def tent(levels=5):
    """An octahedron of radius 100 mm, split: every ray's radius is known."""
    points = np.array([[100.0, 0, 0], [0, 100, 0], [-100, 0, 0], [0, -100, 0], [0, 0, 100], [0, 0, -100]])
    triangles = [[k, (k + 1) % 4, 4] for k in range(4)] + [[(k + 1) % 4, k, 5] for k in range(4)]
    vertices, triangles = points[np.array(triangles)].reshape(-1, 3), np.arange(24).reshape(-1, 3)
    for _ in range(levels):
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        vertices = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        triangles = np.arange(len(vertices)).reshape(-1, 3)
    return Mesh.from_triangles(vertices, triangles, colour=np.float32(np.abs(vertices) / 100))


@pytest.mark.parametrize("levels", [0, 4])
def test_the_radius_of_every_ray_is_exact(levels):
    made = resample(tent(levels), 90, 40, origin=np.zeros(3), axes=np.eye(3))
    a, z = np.meshgrid(made.longitudes, made.heights)
    exact = (100 - np.abs(z)) / (np.abs(np.sin(a)) + np.abs(np.cos(a)))
    assert made.valid.all() and made.closed
    np.testing.assert_allclose(made.radius, exact, atol=1e-9)
    points = np.abs(made.points()) / 100
    np.testing.assert_allclose(made.colour, points, atol=1e-5)


def test_the_outer_of_two_surfaces_is_seen_and_grazing_ones_are_not():
    ring = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    wall = np.array([[r * np.sin(a), -r * np.cos(a), z] for r in (50.0, 90.0) for z in (-20.0, 20.0) for a in ring])
    k, n = np.arange(60), (np.arange(60) + 1) % 60
    quads = np.concatenate([np.stack([k, n, n + 60, k + 60], axis=1), np.stack([k, n, n + 60, k + 60], axis=1) + 120])
    mesh = Mesh(wall, quads.astype(np.int32))
    made = resample(mesh, 120, 10, origin=np.zeros(3))
    assert made.valid.all() and made.radius.min() > 89
    cone = mesh.moved(wall * np.where(wall[:, 2:] > 0, [0.1, 0.1, 1], 1))
    assert resample(cone, 120, 10, origin=np.zeros(3)).valid.all()
    assert not resample(cone, 120, 10, origin=np.zeros(3), grazing=np.radians(30)).valid.any()


def test_texels_and_places_are_each_others_inverse():
    made = resample(tent(2), 64, 32, origin=[1.0, 2, 3])
    made = made.moved(np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]]), [5, 6, 7])
    rows, columns, radius = made.texels(made.points())
    i, j = np.indices(made.shape)
    np.testing.assert_allclose(rows, i, atol=1e-9)
    np.testing.assert_allclose(columns, j, atol=1e-9)
    np.testing.assert_allclose(radius, made.radius)
    np.testing.assert_allclose(made.place(rows, columns), made.points(), atol=1e-9)


def test_another_front_leaves_every_point_in_its_place():
    made = resample(tent(2), 64, 32, origin=[1.0, 2, 3])
    turned = made.fronted(50)
    assert turned.longitudes[32] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(turned.points()[:, 32], made.points()[:, 50], atol=1e-9)
    near = np.sort(turned.points().reshape(-1, 3).round(6), axis=0)
    np.testing.assert_allclose(near, np.sort(made.points().reshape(-1, 3).round(6), axis=0), atol=1e-5)


def test_a_map_becomes_a_mesh_again(reference):
    skin = reference.skin
    made = resample(skin, 256, 128)
    mesh = to_mesh(made)
    surface = Surface(skin.vertices, skin.triangles)
    assert surface.closest(mesh.vertices).distance.max() < 1e-6
    normals = vertex_normals(mesh.vertices, mesh.triangles)
    axis = made.origin * [1, 1, 0]
    out = mesh.vertices * [1, 1, 0] - axis
    assert (np.einsum("ij,ij->i", normals, out) > 0).mean() > 0.95  # wound to face outward
    face = np.asarray(reference.groups["face"]) > 0.5
    back = Surface(mesh.vertices, mesh.triangles).closest(skin.vertices[face & (reference.groups["inner"] < 0.5)])
    assert np.median(back.distance) < 0.2


def test_holes_and_jumps_of_a_map_are_holes_of_the_mesh():
    made = resample(tent(3), 64, 32, origin=np.zeros(3))
    whole = to_mesh(made)
    made.valid[10:14, 20:30] = False
    made.radius[~made.valid] = np.nan
    holed = to_mesh(made)
    assert len(whole.faces) - len(holed.faces) == 11 * 5 - 4  # the corners stay as triangles
    assert np.isfinite(holed.vertices).all()
    step = made.radius.copy()
    step[:, 32:] -= 40
    torn = to_mesh(made.__class__(**{**vars(made), "radius": step}))
    assert len(torn.faces) < len(holed.faces) - 20
    assert len(to_mesh(made.__class__(**{**vars(made), "radius": step}), tear=None).faces) == len(holed.faces)


def test_unknown_colours_are_relaxed_from_those_around():
    made = resample(tent(3), 64, 32, origin=np.zeros(3), span=(-40, 40))
    made.colour[...] = np.linspace(0.2, 0.6, 32)[:, None, None]
    made.colour[12:18, 20:26] = np.nan
    mesh = to_mesh(made)
    assert np.isfinite(mesh.colour).all()
    expected = np.interp(mesh.vertices[:, 2], made.heights[::-1], np.linspace(0.6, 0.2, 32))
    np.testing.assert_allclose(mesh.colour[:, 0], expected, atol=0.02)


def test_an_unrolled_map_is_recovered_and_other_meshes_are_none(reference):
    rng = np.random.default_rng(2)
    made = replace(resample(tent(3), 90, 40, origin=[1.0, 2, 3], span=(-50, 60)), first=-0.6, step=0.03)
    tilt, _ = np.linalg.qr(np.eye(3) + 0.05 * rng.normal(size=(3, 3)))
    made = made.moved(tilt * np.sign(np.diag(tilt)), [4, 5, 6])
    mesh = to_mesh(made, tear=None)
    again = unrolled(mesh)
    assert again.shape == made.shape and not again.closed
    np.testing.assert_allclose(again.points(), made.points(), atol=1e-6)
    np.testing.assert_allclose(again.colour, made.colour, atol=1e-6)
    np.testing.assert_allclose([again.step, again.rise], [made.step, made.rise], rtol=1e-6)
    assert unrolled(reference.skin) is None
    assert unrolled(mesh.moved(mesh.vertices + rng.normal(scale=0.1, size=mesh.vertices.shape))) is None


def test_a_scanners_patch_gives_back_its_own_map(shared):
    mesh = read_ply(shared / "scans" / "fran_cyberware.ply")
    made = unrolled(mesh)
    assert made.shape == (49, 45) and made.valid.all()
    assert 2 * np.pi / made.step == pytest.approx(512 / 3, rel=1e-3)  # every third longitude of 512
    assert made.rise == pytest.approx(3.2, abs=1e-3)
    near = cKDTree(mesh.vertices).query(made.points().reshape(-1, 3))[0]
    assert near.max() < 1e-3
