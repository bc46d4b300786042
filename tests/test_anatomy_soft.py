# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, teeth, tongue and muscles of the reference head."""

import csv

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.anatomy.head import MATERIALS
from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.muscle_shape import Room, muscle_shape, reshaped
from headshop.sim.anatomy.storage import load_head
from headshop.sim.anatomy.tissue_depth import TABLE


@pytest.fixture(scope="module")
def head():
    return load_head()


def rows():
    with open(TABLE.with_name("muscles.csv"), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def outer_skin(head):
    """Triangles of the skin without the lining of mouth, nose and lids."""
    return head.skin.triangles[head.groups["inner"][head.skin.triangles].max(axis=1) < 0.5]


def closed(mesh):
    t = mesh.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    forth = np.unique(directed, axis=0)
    return len(forth) == len(directed) and np.array_equal(forth, np.unique(directed[:, ::-1], axis=0))


def volume(mesh):
    corner = mesh.vertices[mesh.triangles] - mesh.vertices.mean(axis=0)
    return np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6


@pytest.mark.parametrize("part", ["eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue"])
def test_parts_are_closed_and_dressed(head, part):
    mesh = head.parts[part]
    assert closed(mesh) and volume(mesh) > 0
    assert set(np.unique(mesh.material)) == set(range(len(MATERIALS[part])))


@pytest.mark.parametrize("part", ["eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue"])
def test_parts_hide_behind_the_skin(head, part):
    least = 0.05 if part.startswith("eye") else 0.4  # the eyes are open
    assert (winding_number(head.parts[part].vertices, head.skin.vertices, outer_skin(head)) > least).all()


@pytest.mark.parametrize("part", ["teeth_upper", "teeth_lower", "tongue"])
def test_nothing_pokes_through_the_mouth(head, part):
    """Teeth and tongue are in the mouth's hollow, not in the flesh of lips and cheeks."""
    assert not inside(head.parts[part].vertices, head.skin.vertices, head.skin.triangles).any()


def test_sides_mirror(head):
    np.testing.assert_allclose(head.parts["eye_l"].vertices * [-1, 1, 1], head.parts["eye_r"].vertices, atol=1e-9)
    for part in ("teeth_upper", "teeth_lower", "tongue"):
        vertices = head.parts[part].vertices
        assert cKDTree(vertices).query(vertices * [-1, 1, 1])[0].max() < 0.02


def test_eyes_touch_the_lids_and_look_ahead(head):
    for eye, side in zip(head.eyes, "lr", strict=True):
        assert 11 < eye.radius < 13
        np.testing.assert_allclose(eye.gaze, [0, -1, 0])
        mesh = head.parts[f"eye_{side}"]
        pupil = mesh.vertices[np.unique(mesh.faces[mesh.material == 2][:, :3])].mean(axis=0)
        assert (pupil - eye.centre) @ eye.gaze > 0.7 * eye.radius
        lids = head.groups[f"lid_upper_{side}"] + head.groups[f"lid_lower_{side}"] > 0.5
        distance = np.linalg.norm(head.skin.vertices[lids] - eye.centre, axis=1)
        assert -0.2 < distance.min() - eye.radius < 1.0


def pieces(mesh):
    """Vertex index arrays of the enamel's connected pieces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    t = mesh.triangles
    n = len(mesh.vertices)
    link = coo_matrix((np.ones(2 * len(t)), (np.r_[t[:, 0], t[:, 0]], np.r_[t[:, 1], t[:, 2]])), shape=(n, n))
    label = connected_components(link, directed=False)[1]
    enamel = np.unique(mesh.faces[mesh.material == 0][:, :3])
    return [np.flatnonzero(label == k) for k in np.unique(label[enamel])]


def test_thirty_two_teeth(head):
    assert [len(pieces(head.parts[p])) for p in ("teeth_upper", "teeth_lower")] == [16, 16]


def test_rows_bite_without_cutting(head):
    upper, lower = head.parts["teeth_upper"], head.parts["teeth_lower"]
    bite = {}
    for name, mesh in (("upper", upper), ("lower", lower)):
        enamel = np.unique(mesh.faces[mesh.material == 0][:, :3])
        v = mesh.vertices[enamel]
        bite[name] = v[np.abs(v[:, 0]) < 4]
    overlap = bite["lower"][:, 2].max() - bite["upper"][:, 2].min()
    assert 0.2 < overlap < 4
    edge_upper = bite["upper"][bite["upper"][:, 2].argmin()]
    edge_lower = bite["lower"][bite["lower"][:, 2].argmax()]
    assert 0.5 < edge_lower[1] - edge_upper[1] < 5  # overjet: the lower edge bites behind
    assert not inside(lower.vertices, upper.vertices, upper.triangles).any()
    assert not inside(upper.vertices, lower.vertices, lower.triangles).any()


def test_tongue_rests_within_the_lower_row(head):
    tongue, lower, upper = (head.parts[p] for p in ("tongue", "teeth_lower", "teeth_upper"))
    for row in (lower, upper):
        assert not inside(tongue.vertices, row.vertices, row.triangles).any()
    assert np.abs(tongue.vertices[:, 0]).max() < np.abs(lower.vertices[:, 0]).max()
    assert tongue.vertices[:, 1].min() > lower.vertices[:, 1].min()


def test_muscles_are_those_of_the_table(head):
    names = {m.name for m in head.muscles}
    wanted = {r["name"] + s for r in rows() for s in (("_l", "_r") if r["paired"] == "1" else ("",))}
    assert names == wanted and len(rows()) >= 24
    assert all(r["source"] and r["basis"] for r in rows())


def test_fibres_lie_between_skin_and_bone(head):
    left = [k for k, m in enumerate(head.muscles) if not m.name.endswith("_r")]
    points = np.concatenate([head.muscles[k].fibres.reshape(-1, 3) for k in left])
    owner = np.concatenate([[k] * (head.muscles[k].fibres.size // 3) for k in left])
    out = ~inside(points, head.skin.vertices, outer_skin(head))
    assert not out.any(), {head.muscles[k].name for k in owner[out]}
    bones = [(head.parts[p].vertices, head.parts[p].triangles) for p in ("skull", "mandible")]
    buried = np.any([inside(points, *bone) for bone in bones], axis=0)
    shares = {head.muscles[k].name: buried[owner == k].mean() for k in np.unique(owner[buried])}
    assert max(shares.values(), default=0) < 0.10, shares


def test_origins_hold_to_their_bone(head):
    trees = {p: cKDTree(head.parts[p].vertices) for p in ("skull", "mandible")}
    for m in head.muscles:
        if m.origin in trees and not m.ring:
            assert np.median(trees[m.origin].query(m.fibres[:, 0])[0]) < 9.5, m.name
        if m.insertion == "mandible":
            assert np.median(trees["mandible"].query(m.fibres[:, -1])[0]) < 9.5, m.name


def test_muscles_mirror(head):
    by_name = {m.name: m for m in head.muscles}
    for name, m in by_name.items():
        if name.endswith("_l"):
            np.testing.assert_allclose(by_name[name[:-2] + "_r"].fibres * [-1, 1, 1], m.fibres, atol=1e-3)


def test_modiolus_is_one_point(head):
    knot = ("zygomaticus_major", "levator_anguli_oris", "risorius", "buccinator", "depressor_anguli_oris")
    ends = np.concatenate([m.fibres[:, -1] for m in head.muscles if m.name in {k + "_l" for k in knot}])
    assert np.ptp(ends, axis=0).max() < 0.5
    corner = head.landmark_positions()["ch_l"]
    assert np.linalg.norm(ends.mean(axis=0) - corner) < 18 and ends[0, 0] > corner[0]


def test_muscles_run_the_right_way(head):
    """A surgeon's glance: each of these pulls its insertion toward its origin."""
    pull = {m.name: (m.fibres[:, 0] - m.fibres[:, -1]).mean(axis=0) for m in head.muscles}
    assert pull["zygomaticus_major_l"][2] > 20 and pull["zygomaticus_major_l"][0] > 8
    assert pull["depressor_anguli_oris_l"][2] < -12
    assert pull["risorius_l"][0] > 12 and abs(pull["risorius_l"][2]) < 20
    assert pull["frontalis_inner_l"][2] > 25 and abs(pull["frontalis_inner_l"][0]) < 8
    assert pull["corrugator_l"][0] < -12 and abs(pull["corrugator_l"][2]) < 14
    assert pull["procerus"][2] < -20
    assert pull["levator_labii_superioris_l"][2] > 20
    assert pull["depressor_labii_inferioris_l"][2] < -8
    assert pull["mentalis_l"][2] > 5
    assert pull["masseter_l"][2] > 30 and pull["masseter_l"][1] < 0
    assert pull["temporalis_l"][2] > 30


def test_sphincters_surround(head):
    for m in head.muscles:
        if m.ring:
            assert m.kind == "sphincter" and m.centre is not None
            ring = m.fibres.mean(axis=0) - m.centre
            turns = np.unwrap(np.append(a := np.arctan2(ring[:, 2], ring[:, 0]), a[0]))
            assert abs(abs(turns[-1] - turns[0]) - 2 * np.pi) < 0.1, m.name


def test_bellies_are_closed_and_in_the_head(head):
    for m in head.muscles:
        assert closed(m.shape) and volume(m.shape) > 0, m.name
    shapes = np.concatenate([m.shape.vertices[::3] for m in head.muscles if not m.name.endswith("_r")])
    assert inside(shapes, head.skin.vertices, outer_skin(head)).mean() > 0.995


def test_bellies_follow_a_warp(head):
    muscle = next(m for m in head.muscles if m.name == "zygomaticus_major_l")
    moved = reshaped(muscle, muscle.fibres + [5.0, 0, 0], centre=None)
    assert np.array_equal(moved.shape.faces, muscle.shape.faces)
    assert moved.shape.vertices.shape == muscle.shape.vertices.shape
    np.testing.assert_allclose(moved.shape.vertices.mean(0) - muscle.shape.vertices.mean(0), [5, 0, 0], atol=1.5)


def test_belly_swells_and_tapers():
    t = np.linspace(0, 40, 12)
    fibres = np.stack([np.stack([t, np.full(12, y), 0 * t], axis=1) for y in (-3.0, 0.0, 3.0)])
    mesh = muscle_shape(fibres, width=6, thickness=4)
    assert closed(mesh) and volume(mesh) > 0
    z = np.abs(mesh.vertices[:, 2])
    middle = np.abs(mesh.vertices[:, 0] - 20) < 4
    ends = mesh.vertices[:, 0] < 1
    assert 1.5 < z[middle].max() <= 2.01 and z[ends].max() < 0.6


def test_belly_stays_in_its_room(head):
    fibres = next(m for m in head.muscles if m.name == "frontalis_inner_l").fibres
    room = Room(head.skin, [head.parts["skull"]])
    free, bounded = muscle_shape(fibres, 8, 14), muscle_shape(fibres, 8, 14, room=room)
    poking = [(~inside(m.vertices, head.skin.vertices, head.skin.triangles)).sum() for m in (free, bounded)]
    assert poking[0] > 10 and poking[1] < 0.2 * poking[0]
