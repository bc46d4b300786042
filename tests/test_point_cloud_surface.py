# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of points without faces: where they lie, which side is out, what stays open and what is left out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh, edges
from headshop.sim.point_cloud.facing import outward
from headshop.sim.point_cloud.meshed import meshed, meshing
from headshop.sim.point_cloud.neighbourhoods import nearest, planes
from headshop.sim.point_cloud.sphere_fit import Spheres
from headshop.sim.point_cloud.surface_nets import Grid
from headshop.sim.scan.clean import clean_scan
from headshop.sim.triangle_projection import closest_on_triangles

NONE = np.zeros((0, 4), np.int32)


def ball(count: int, radius: float = 60.0) -> np.ndarray:
    """(count, 3) points evenly on a sphere, along a spiral."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5)) * k
    return radius * np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)


def facing(mesh):
    """Middles (t, 3) and unit normals (t, 3) of the triangles."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    return (a + b + c) / 3, normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def borders(mesh):
    """Vertices at which the mesh ends."""
    side = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    side, count = np.unique(side, axis=0, return_counts=True)
    return np.unique(side[count == 1])


def test_a_ball_of_points_becomes_a_closed_ball_outside_out():
    mesh = meshed(Mesh(ball(6000), NONE))
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radius - 60).max() < 0.02  # spheres fit it: planes would lie .03 mm outside, and its chords inside
    middle, normal = facing(mesh)
    assert (np.einsum("ij,ij->i", middle, normal) > 0).all()
    assert len(borders(mesh)) == 0
    assert len(mesh.vertices) - len(edges(mesh.faces)) + len(mesh.faces) == 2


@pytest.mark.parametrize("scale", [1e-3, 25.4])
def test_the_unit_does_not_matter(scale):
    one, other = (meshed(Mesh(factor * ball(2000), NONE)) for factor in (1.0, scale))
    assert abs(len(other.faces) / len(one.faces) - 1) < 0.05
    assert np.abs(np.linalg.norm(other.vertices, axis=1) / scale - 60).max() < 0.1


def test_what_the_points_do_not_show_stays_open():
    points = ball(6000)
    points = points[(points[:, 2] > -20) & (np.linalg.norm(points[:, :2], axis=1) > 15)]
    mesh = meshed(Mesh(points, NONE))
    apart = cKDTree(points).query(points, k=2)[0][:, 1].mean()
    assert cKDTree(points).query(mesh.vertices)[0].max() < 2 * apart
    ends = mesh.vertices[borders(mesh)]
    low, top = ends[:, 2] < 0, ends[:, 2] > 0
    assert np.abs(ends[low, 2] + 20).max() < 2.5 * apart and low.sum() > 100
    assert np.abs(np.linalg.norm(ends[top, :2], axis=1) - 15).max() < 2.5 * apart and top.sum() > 30


def test_gaps_that_chance_leaves_between_points_are_closed():
    rng = np.random.default_rng(3)
    points = rng.standard_normal((9000, 3))
    points *= 60 / np.linalg.norm(points, axis=1, keepdims=True)
    mesh = meshed(Mesh(points, NONE))
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 60).max() < 0.15
    assert len(borders(mesh)) < 0.002 * len(mesh.vertices)


def sheet(thick: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) on all of a sheet of 60 mm by 60, 1.2 mm apart, and the normals there."""
    along = np.linspace(-30, 30, 51)
    x, y = np.meshgrid(along, along)
    side = np.stack([x, y, np.full_like(x, thick / 2)], axis=-1).reshape(-1, 3)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)[1:-1]
    out = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=-1)[:, None] + np.zeros((51, 1))
    rim = (np.stack([0 * along + 30, along, 0 * along], axis=-1) + thick / 2 * out).reshape(-1, 3)
    out, up = out.reshape(-1, 3), np.tile([0, 0, 1.0], (len(side), 1))
    turns = [(order, flip) for order in ([0, 1, 2], [1, 0, 2]) for flip in (1, -1)]
    points = [side, -side, *(flip * rim[:, order] for order, flip in turns)]
    return np.concatenate(points), np.concatenate([up, -up, *(flip * out[:, order] for order, flip in turns)])


def test_both_sides_of_a_thin_sheet_face_out():
    """As those of an ear do."""
    middle, normal = facing(meshed(Mesh(sheet(3.0)[0], NONE)))
    flat = (np.abs(middle[:, :2]) < 27).all(axis=1)
    assert flat.sum() > 2000
    assert (np.abs(np.abs(middle[flat, 2]) - 1.5) < 0.1).all()
    assert (normal[flat, 2] * middle[flat, 2] > 0).all()


def test_sides_are_not_passed_on_through_a_sheet():
    """The nearest on the other side lies in a plane as alike as those beside it."""
    points, normals = sheet(0.8)
    turned = outward(
        points, normals * np.random.default_rng(12).choice([-1, 1], (len(points), 1)), nearest(points, 12)[1]
    )
    assert (np.einsum("ij,ij->i", turned, normals) > 0).all()


def test_noise_is_averaged_and_makes_cells_wider():
    rng = np.random.default_rng(4)
    points = ball(40_000)
    noisy = meshed(Mesh(points + rng.normal(0, 0.8, points.shape), NONE))
    off = np.linalg.norm(noisy.vertices, axis=1) - 60
    assert off.std() < 0.4 and abs(off.mean()) < 0.05
    assert len(noisy.faces) < 0.5 * len(meshed(Mesh(points, NONE)).faces)


def test_specks_and_strays_are_left_out():
    rng = np.random.default_rng(5)
    points = ball(6000)
    speck = np.array([0, 0, 75.0]) + rng.normal(0, 0.5, (20, 3))
    patch = np.array([0, 0, 85.0]) + np.concatenate([rng.uniform(-6, 6, (60, 2)), np.zeros((60, 1))], axis=1)
    mesh = meshed(Mesh(np.concatenate([points, speck, patch, [[1e7, 0, 0], [np.nan, 0, 0]]]), NONE))
    away = np.linalg.norm(mesh.vertices, axis=1) - 60
    assert (np.abs(away[away < 20]) < 0.05).all()  # of the speck nothing
    assert (away > 20).sum() > 30 and away.max() < 27  # a patch of more points is one


def test_points_all_over_the_place_are_left_out():
    """As flying pixels and wrong matches are; they reach as far as the points about them, and would fill the space."""
    rng = np.random.default_rng(9)
    strewn = rng.uniform(-90, 90, (400, 3))
    for noise in (0.0, 0.5):
        points = ball(40_000) + rng.normal(0, noise, (40_000, 3))
        mesh = meshed(Mesh(np.concatenate([points, strewn]), NONE))
        off = np.abs(np.linalg.norm(mesh.vertices, axis=1) - 60)
        assert (off < 2).mean() > 0.98 and len(mesh.vertices) > 5000


def test_noise_of_what_is_far_does_not_coarsen_what_is_near():
    """A wall behind somebody, as depth cameras see it: most of the points, and the noisiest."""
    rng = np.random.default_rng(10)
    x, y = rng.uniform(-300, 300, (2, 30_000))
    wall = np.stack([x, y, rng.normal(-400, 6, 30_000)], axis=1)
    mesh = meshed(Mesh(np.concatenate([ball(20_000), wall]), NONE))
    near = np.linalg.norm(mesh.vertices, axis=1) < 70
    assert np.abs(np.linalg.norm(mesh.vertices[near], axis=1) - 60).max() < 0.1
    assert near.sum() > 6000
    behind = mesh.vertices[mesh.vertices[:, 2] < -350, 2]
    assert len(behind) > 500 and behind.std() < 4


def test_points_far_apart_beside_close_ones():
    """A grid as fine as the close ones reaches across the others as well."""
    close, far = ball(12_000), ball(1500)
    mesh = meshed(Mesh(np.concatenate([close[close[:, 0] > 0], far[far[:, 0] <= 0]]), NONE))
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 60).max() < 0.25
    area = np.linalg.norm(
        np.cross(*(mesh.vertices[mesh.triangles[:, k]] - mesh.vertices[mesh.triangles[:, 0]] for k in (1, 2))), axis=1
    )
    assert area.sum() / 2 == pytest.approx(4 * np.pi * 60**2, rel=0.01)


def test_normals_that_are_given_say_which_side_is_out():
    points = ball(3000)
    middle, normal = facing(meshed(Mesh(points, NONE, normals=(-points / 60).astype(np.float32))))
    assert (np.einsum("ij,ij->i", middle, normal) < 0).all()


def test_points_that_a_camera_did_not_measure():
    """They stand at the origin, or have no place, or no normal."""
    points = ball(4000) + [0, 0, 500.0]
    normals = ((points - [0, 0, 500.0]) / -60).astype(np.float32)
    normals[::7] = np.nan
    nothing = np.concatenate([np.zeros((6000, 3)), np.full((500, 3), np.nan)])
    cloud = Mesh(np.concatenate([points, nothing]), NONE, normals=np.concatenate([normals, nothing.astype(np.float32)]))
    mesh = meshed(cloud)
    assert np.abs(np.linalg.norm(mesh.vertices - [0, 0, 500.0], axis=1) - 60).max() < 0.1
    middle, normal = facing(mesh)
    assert len(borders(mesh)) == 0 and (
        abs(np.sign(np.einsum("ij,ij->i", middle - [0, 0, 500.0], normal)).sum()) == len(normal)
    )


@pytest.mark.parametrize("sign", [0.0, 1.0])
def test_normals_whose_signs_are_left_to_chance_are_not_heard(sign):
    points = ball(3000)
    normals = points / 60 * sign * np.random.default_rng(8).choice([-1, 1], (3000, 1))
    middle, normal = facing(meshed(Mesh(points, NONE, normals=normals.astype(np.float32))))
    assert (np.einsum("ij,ij->i", middle, normal) > 0).all()


def test_colours_are_those_of_the_points_about():
    points = ball(3000)
    colour = np.where(points[:, 2:] > 0, np.float32([[1, 0, 0]]), np.float32([[0, 0, 1]]))
    mesh = meshed(Mesh(points, NONE, colour=colour))
    far = np.abs(mesh.vertices[:, 2]) > 8
    wanted = np.where(mesh.vertices[:, 2:] > 0, [[1, 0, 0]], [[0, 0, 1]])
    np.testing.assert_allclose(mesh.colour[far], wanted[far], atol=1e-6)
    assert mesh.colour.dtype == np.float32 and meshed(Mesh(points, NONE)).colour is None


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (ball(900), "only 900 points"),
        (np.zeros((5000, 3)), "only 1 points"),
        (np.full((5000, 3), np.nan), "only 0 points"),
    ],
)
def test_what_shows_no_surface_is_refused(points, says):
    with pytest.raises(InputError, match=says) as caught:
        meshed(Mesh(points, NONE))
    assert str(caught.value).endswith(".") and str(caught.value).count(". ") == 0


def test_points_in_a_solid_or_on_a_line_are_refused():
    rng = np.random.default_rng(6)
    for cloud in (rng.uniform(-50, 50, (20_000, 3)), np.linspace(0, 100, 5000)[:, None] * [[1.0, 0, 0]]):
        with pytest.raises(InputError):
            clean_scan(Mesh(cloud, NONE))


def test_cleaning_says_of_how_many_points_a_scan_was_made():
    mesh, counts = clean_scan(Mesh(ball(3000), NONE))
    assert counts["points"] == 3000 and counts["triangles"] == len(mesh.triangles) and counts["components"] == 1
    assert clean_scan(mesh)[1]["points"] == 0


def test_progress_rises_and_work_can_be_left():
    steps = [step.fraction for step in meshing(Mesh(ball(3000), NONE))]
    assert steps == sorted(steps) and len(steps) > 6 and 0 <= steps[0] and steps[-1] <= 1
    work = meshing(Mesh(ball(3000), NONE))
    next(work)
    work.close()


def test_spheres_are_exact_on_a_sphere_and_on_a_plane():
    points = ball(500, 10.0)
    spheres = Spheres(points, points / 10, np.ones(500), np.zeros((500, 0)))
    places = ball(77, 1.0) * np.linspace(8, 12, 77)[:, None]
    np.testing.assert_allclose(spheres.outside(places), np.linalg.norm(places, axis=1) - 10, atol=1e-9)
    moved = spheres.onto(places)[0]
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 10, atol=1e-9)
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0))
    plane = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    flat = Spheres(plane, np.tile([0, 0, 1.0], (144, 1)), np.ones(144), np.zeros((144, 0)))
    np.testing.assert_allclose(flat.outside(np.array([[5.3, 6.1, 0.4], [4.0, 4.0, -0.7]])), [0.4, -0.7], atol=1e-9)


def test_the_other_side_of_a_sheet_is_not_heard():
    points, normals = sheet(0.8)
    spheres = Spheres(points, normals, np.full(len(points), 1.2), np.zeros((len(points), 0)))
    places = np.array([[3.3, 2.1, 0.7], [-7.0, 9.4, 0.5], [0.5, 0.2, -0.9]])
    np.testing.assert_allclose(spheres.outside(places), [0.3, 0.1, 0.5], atol=1e-9)


def test_far_points_count_as_much_as_close_ones():
    """On the edge of where they are close, more of the nearest lie on that side; the surface is not drawn by them alone."""
    close, far = (
        np.meshgrid(np.arange(-6, 0, 0.5), np.arange(-6, 6, 0.5)),
        np.meshgrid(np.arange(1, 9, 2.0), np.arange(-6, 6, 2.0)),
    )
    flat = [np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1) for x, y in (close, far)]
    lifted = np.concatenate([flat[0], flat[1] + [0, 0, 1.0]])
    apart = np.concatenate([np.full(len(flat[0]), 0.5), np.full(len(flat[1]), 2.0)])
    spheres = [
        Spheres(lifted, np.tile([0, 0, 1.0], (len(lifted), 1)), a, np.zeros((len(lifted), 0)))
        for a in (apart, apart * 0 + 1)
    ]
    fair, unfair = (s.outside(np.array([[0.4, 0.3, 0.5]]))[0] for s in spheres)
    assert fair < unfair - 0.1  # the far ones lie higher


def test_sides_are_passed_on_whatever_they_were():
    points = ball(2000)
    near = nearest(points, 12)[1]
    normals = planes(points, near)[0]
    rng = np.random.default_rng(7)
    normals *= rng.choice([-1, 1], (2000, 1))
    turned = outward(points, normals, near)
    assert (np.einsum("ij,ij->i", turned, points) > 0).all()
    apart = np.concatenate([points, points + [500.0, 0, 0]])  # two pieces, each bulging from its own middle
    turned = outward(apart, np.concatenate([normals, -normals]), np.concatenate([near, near + 2000]))
    assert (np.einsum("ij,ij->i", turned, np.concatenate([points, points])) > 0).all()


def test_a_patch_faces_away_from_the_whole():
    """As hair on the crown, the rest of which was not seen, and a dish at that: by itself it bulges the other way."""
    rng = np.random.default_rng(13)
    patch = rng.uniform(-8, 8, (80, 2))
    dish = np.column_stack([patch, 80 + (patch**2).sum(axis=1) / 40])
    points = np.concatenate([ball(2000), dish])
    normals = np.concatenate([ball(2000), np.column_stack([-patch / 20, np.ones(80)])])
    near = np.concatenate([nearest(ball(2000), 8)[1], 2000 + nearest(dish, 8)[1]])
    turned = outward(points, normals / np.linalg.norm(normals, axis=1, keepdims=True), near)
    assert (np.einsum("ij,ij->i", turned, normals) > 0).all()


def test_a_grid_has_the_surface_of_a_function():
    points = ball(4000, 9.0)
    grid = Grid(points, 0.7)
    vertices, quads = grid.surface(np.linalg.norm(grid.corner, axis=1) - 9)
    mesh = Mesh(vertices, quads.astype(np.int32))
    assert np.abs(np.linalg.norm(vertices, axis=1) - 9).max() < 0.05
    middle, normal = facing(mesh)
    assert (np.einsum("ij,ij->i", middle, normal) > 0).all() and len(borders(mesh)) == 0
    assert len(grid.surface(np.ones(len(grid.corner)))[1]) == 0


def test_a_mesh_without_its_faces_gives_nearly_the_same(reference):
    skin = reference.skin
    mesh = meshed(replace(skin, faces=NONE, uv=None, material=None))
    near = cKDTree(facing(mesh)[0]).query(skin.vertices, k=12)[1]
    corners = mesh.vertices[mesh.triangles[near.ravel()]].transpose(1, 0, 2)
    distance = closest_on_triangles(np.repeat(skin.vertices, 12, axis=0), *corners)[1].reshape(-1, 12).min(axis=1)
    assert np.median(distance) < 0.6  # mm: the skin's vertices are 2 to 12 apart
