# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth, gums and tongue of the reference head."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from headshop.assets.generators.mouth_room import MouthRoom
from headshop.assets.generators.nurbs import NurbsSurface, basis, clamped, periodic
from headshop.assets.generators.skull_depth import sampled
from headshop.assets.generators.teeth_places import mirrored, tooth_places
from headshop.assets.generators.teeth_shape import master, tooth_mesh
from headshop.assets.generators.teeth_sizes import LOWER, UPPER
from headshop.sim.anatomy.head import MATERIALS
from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.storage import load_head
from headshop.sim.health.topology import closed, volume
from headshop.sim.mesh import Mesh

ROWS = {"teeth_upper": ("upper", UPPER), "teeth_lower": ("lower", LOWER)}


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def room(head):
    return MouthRoom(head.skin, head.groups, head.landmark_positions())


@pytest.fixture(scope="module")
def places(head):
    return tooth_places(head.skin, head.groups, head.landmark_positions())


def pieces(mesh, material):
    """Connected pieces of one material as meshes of their own."""
    faces = mesh.faces[mesh.material == material]
    t = Mesh(mesh.vertices, faces).triangles
    n = len(mesh.vertices)
    link = coo_matrix((np.ones(2 * len(t)), (np.r_[t[:, 0], t[:, 0]], np.r_[t[:, 1], t[:, 2]])), shape=(n, n))
    label = connected_components(link, directed=False)[1]
    found = []
    for k in np.unique(label[t[:, 0]]):
        mine = np.flatnonzero(label == k)
        new = np.full(n + 1, -1)
        new[mine] = np.arange(len(mine))
        found.append(Mesh(mesh.vertices[mine], new[faces[label[faces[:, 0]] == k]]))
    return found


def crown(tooth_piece, place):
    """Vertices of a tooth in the head above its neck."""
    return tooth_piece.vertices[(tooth_piece.vertices - place.neck) @ place.axes[2] > 0.3]


def teeth_in_place(head, places, part):
    """(piece, place) from the last right tooth round to the last left one."""
    row = places[ROWS[part][0]]
    row = [mirrored(p) for p in row[::-1]] + row
    found = pieces(head.parts[part], 0)
    middles = np.array([p.vertices.mean(axis=0) for p in found])
    near = [int(np.linalg.norm(middles - (p.neck - p.axes[2]), axis=1).argmin()) for p in row]
    assert len(set(near)) == 16
    return [(found[k], p) for k, p in zip(near, row, strict=True)]


def test_nurbs_of_degree_two_hold_circles_and_spheres():
    s = np.sqrt(0.5)
    arc = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    weights = np.array([1, s, 1])
    half = np.array([[0, 0, -1], [1, 0, -1], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
    half_weights = np.array([1, s, 1, s, 1])
    control = np.array([[[x * a[0], x * a[1], z] for a in arc] for x, _, z in half])
    knots = np.array([0, 0, 0, 0.5, 0.5, 1, 1, 1])
    ball = NurbsSurface(control, np.outer(half_weights, weights), knots, clamped(3))
    points = ball.grid(np.linspace(0, 1, 21), np.linspace(0, 1, 17))
    np.testing.assert_allclose(np.linalg.norm(points, axis=2), 1.0, atol=1e-12)
    assert points[..., 2].min() < -0.999 < 0.999 < points[..., 2].max()


def test_nurbs_close_and_sum_to_one():
    at = np.linspace(0, 1, 41)
    for knots in (clamped(7), periodic(8)):
        np.testing.assert_allclose(basis(knots, at).sum(axis=1), 1.0, atol=1e-12)
    for form in ("incisor", "canine", "premolar", "molar"):
        surface = master(form)
        assert surface.degree == 2
        ends = surface.grid(at, np.array([0.0, 1.0, 0.5]))
        np.testing.assert_allclose(ends[:, 0], ends[:, 1], atol=1e-12)


@pytest.mark.parametrize("tooth", UPPER + LOWER, ids=lambda t: f"{t.form}{t.md}")
def test_sizes_are_those_of_the_table(tooth):
    vertices, faces = tooth_mesh(tooth)
    assert closed(Mesh(vertices, faces)) and volume(Mesh(vertices, faces)) > 0
    above = vertices[vertices[:, 2] > 0.3]
    wide, deep = np.ptp(above[:, :2], axis=0)
    assert abs(wide - tooth.md) < 0.2 and abs(deep - tooth.ll) < 0.5
    assert abs(vertices[:, 2].max() - tooth.crown) < 0.35


@pytest.mark.parametrize("part", ["teeth_upper", "teeth_lower", "tongue"])
def test_parts_are_closed_dressed_and_symmetric(head, part):
    mesh = head.parts[part]
    assert closed(mesh) and volume(mesh) > 0
    assert set(np.unique(mesh.material)) == set(range(len(MATERIALS[part])))
    assert cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])[0].max() < 1e-4


@pytest.mark.parametrize("part", ROWS)
def test_sixteen_rigid_teeth_in_one_gum(head, places, part):
    for piece, place in teeth_in_place(head, places, part):
        made = tooth_mesh(place.tooth)[0] @ place.axes + place.neck
        assert cKDTree(made).query(piece.vertices)[0].max() < 1e-3
        assert volume(piece) > 0
    gums = pieces(head.parts[part], 1)
    assert len(gums) == 1 and volume(gums[0]) > 0


@pytest.mark.parametrize("part", ROWS)
def test_neighbours_touch_without_overlap(head, places, part):
    row = [piece for piece, _ in teeth_in_place(head, places, part)]
    for a, b in zip(row[:-1], row[1:], strict=True):
        first, second = (sampled(m.vertices, m.triangles, 0.4)[0] for m in (a, b))
        assert cKDTree(first).query(second)[0].min() < 0.4  # samples are 0.4 mm apart
        near = second[cKDTree(first).query(second)[0] < 1.0]
        assert not inside(near, a.vertices, a.triangles).any()


def test_rows_bite_without_cutting(head, places):
    upper, lower = (teeth_in_place(head, places, p) for p in ROWS)
    edge_upper = upper[8][0].vertices[upper[8][0].vertices[:, 2].argmin()]
    edge_lower = lower[8][0].vertices[lower[8][0].vertices[:, 2].argmax()]
    assert 1.0 < edge_lower[2] - edge_upper[2] < 3.5  # overbite
    assert 1.0 < edge_lower[1] - edge_upper[1] < 4.0  # overjet
    above = [sampled(m.vertices, m.triangles, 0.4)[0] for m, _ in upper]
    tree, owner = cKDTree(np.concatenate(above)), np.repeat(np.arange(16), [len(p) for p in above])
    for k, (piece, _) in enumerate(lower):
        points = sampled(piece.vertices, piece.triangles, 0.4)[0]
        distance, found = tree.query(points)
        if not 5 <= k <= 10:  # behind the canines
            assert distance.min() < 0.45, k
        near = distance < 1.0
        for other in np.unique(owner[found[near]]):
            mesh = upper[other][0]
            assert not inside(points[near], mesh.vertices, mesh.triangles).any(), (k, other)


@pytest.mark.parametrize("part", ROWS)
def test_crowns_and_gums_lie_in_the_mouth(head, places, room, part):
    gums = pieces(head.parts[part], 1)[0].vertices
    assert room.clearance(gums)[0].min() > 0.1
    for piece, place in teeth_in_place(head, places, part):
        assert room.clearance(crown(piece, place))[0].min() > 0.3


@pytest.mark.parametrize("part", ["teeth_upper", "teeth_lower", "tongue"])
def test_nothing_shows_between_closed_lips(head, part):
    outer = head.skin.triangles[head.groups["inner"][head.skin.triangles].max(axis=1) < 0.5]
    assert (winding_number(head.parts[part].vertices, head.skin.vertices, outer) > 0.4).all()


@pytest.mark.parametrize("part", ROWS)
def test_gums_rise_between_the_teeth(head, places, part):
    """Papillae: toward the crowns the gum reaches farther between two teeth than at the middle of either."""
    gum = pieces(head.parts[part], 1)[0].vertices
    row = places[ROWS[part][0]]
    for a, b in zip(row[:-1], row[1:], strict=True):
        up = []
        for x in (0.0, 0.5):
            at = (gum - a.neck) @ a.axes.T
            near = (np.abs(at[:, 0] - x * a.tooth.md) < 0.16 * a.tooth.md) & (at[:, 1] > 0) & (at[:, 2] > -1.5)
            up.append(at[near, 2].max())
        assert up[1] > up[0] + 0.7, (a.tooth, b.tooth)


def test_the_tongue_rests_within_the_rows(head, places, room):
    tongue = head.parts["tongue"]
    assert 300 <= len(tongue.vertices) <= 500 and (tongue.faces[:, 3] >= 0).mean() > 0.97
    for part in ROWS:
        row = head.parts[part]
        assert not inside(tongue.vertices, row.vertices, row.triangles).any()
        assert cKDTree(sampled(row.vertices, row.triangles, 0.8)[0]).query(tongue.vertices)[0].min() > 0.3
    assert room.clearance(tongue.vertices)[0].min() > 0.3
    tip = tongue.vertices[tongue.vertices[:, 1].argmin()]
    incisor = places["lower"][0]
    assert 0 < tip[1] - incisor.neck[1] < 9 and tip[2] < incisor.neck[2] + incisor.tooth.crown
