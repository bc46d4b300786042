# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact on the surface that is drawn: between its points, lips, teeth, eyeballs and bone keep out of each other."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.acting.arkit import over, poses
from headshop.sim.acting.pose import Pose, combined, control, pose_from
from headshop.sim.anatomy.inside import inside
from headshop.sim.health.penetration import NAMES, Ruler
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import limit, smoother, subdivision
from headshop.sim.tissue.clearing import PAIRS, cleared, surfaces_of
from headshop.sim.tissue.drawn_samples import drawn_samples, planes_of
from headshop.sim.tissue.energy import pose_of
from headshop.sim.tissue.eye_surface import eyeball_radius
from headshop.sim.tissue.frames import Frames
from headshop.sim.tissue.gingiva import attached
from headshop.sim.tissue.planes import row_depths, row_energy
from headshop.sim.tissue.regions import REGIONS
from headshop.sim.tissue.solids import build_solid
from headshop.sim.tissue.solver import rest_state, solve

SHOWN = ("eyeBlinkLeft", "mouthRollUpper", "mouthClose", "noseSneerLeft")
#: Where bone went through the floor of the mouth, lips past each other, their corners and the last molar into each other,
#: and where a corner of the lips turned inside out on its way out of the other lip.
WORST = (
    ("jawOpen", "mouthClose"),
    ("mouthPucker", "mouthRollLower"),
    ("jawLeft", "mouthRollUpper"),
    ("jawForward", "jawRight"),
    ("mouthClose", "mouthPressLeft"),
    ("jawRight", "mouthRollLower"),
)


@pytest.fixture(scope="module")
def solved(reference_model):
    return {name: solve(reference_model, control(reference_model, poses()[name]), max_iterations=200) for name in SHOWN}


def test_samples_lie_on_the_limit_surface(reference):
    skin, faces = reference.skin.vertices, reference.skin.faces
    chosen = np.asarray(reference.groups["lip_upper"]) > 0.5
    samples = drawn_samples(faces, skin, chosen)
    fine, quads, _ = subdivision(faces, len(skin), 2)
    truth = limit(quads, fine.shape[0]) @ (fine @ skin)
    at = samples.at(skin)
    assert cKDTree(truth).query(at)[0].max() < 0.01
    own = smoother(faces, len(skin))[0][: len(skin)] @ skin
    np.testing.assert_allclose(at[: chosen.sum()], own[chosen], atol=0.01)
    assert np.allclose(samples.weight.sum(axis=1), 1) and len(samples) > 2 * chosen.sum()


def test_a_push_on_a_sample_is_a_push_on_its_vertices(reference):
    skin = reference.skin.vertices
    samples = drawn_samples(reference.skin.faces, skin, np.asarray(reference.groups["lip_lower"]) > 0.5)
    up = np.tile([0.0, 0, 1], (2, 1))
    height = samples.at(skin)[[3, 8], 2]
    planes = planes_of([(*samples.along(np.array([3, 8]), up), height + [0.5, -1.0])], len(skin))
    np.testing.assert_allclose(row_depths(planes, skin), [0.5, 0], atol=1e-9)
    energy, gradient = row_energy(planes, skin, 4.0)
    assert energy == pytest.approx(0.5 * 4 * 0.25)
    # the forces are shared by weight and add up to what the plane exerts
    np.testing.assert_allclose(gradient.sum(axis=0), [0, 0, -4 * 0.5], atol=1e-9)
    np.testing.assert_allclose(gradient[:, 2], -2 * samples.rows[3].toarray()[0], atol=1e-9)


def _box(low, high):
    corner = np.array([[x, y, z] for x in (low, high) for y in (low, high) for z in (low, high)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corner, np.array(faces)


def test_a_solid_knows_inside_from_outside_and_no_way_out_within():
    outer, faces = _box(-5, 5)
    inner, _ = _box(-2, 2)
    mesh = Mesh(np.concatenate([outer, inner]), np.concatenate([faces, faces + 8]).astype(np.int32))
    solid = build_solid(mesh, False, outer)
    points = np.array([[0, 0, 4.0], [0, 0, 5.5], [5.5, 5.5, 0], [2.1, 0, 0]])
    rows, normal, height, _ = solid.planes(points, np.eye(3), np.zeros(3), 4.0)
    assert rows.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(height, [-1, 0.5, np.sqrt(0.5), -2.9], atol=0.15)
    np.testing.assert_allclose(normal[[0, 3]], [[0, 0, 1], [1, 0, 0]], atol=1e-9)
    assert len(np.unique(solid.points.round(6), axis=0)) == len(solid.points)  # of two on an edge the nearer is chance


def test_gum_in_the_neck_of_a_tooth_is_no_way_out():
    tooth, faces = _box(-5, 5)
    gum = tooth * [0.96, 0.96, 1] + [0, 0, -6.0]
    kind = np.repeat([0, 1], len(faces)).astype(np.int16)
    mesh = Mesh(np.concatenate([tooth, gum]), np.concatenate([faces, faces + 8]).astype(np.int32), material=kind)
    solid = build_solid(mesh, False, np.concatenate([tooth, gum]))
    of_gum = solid.points[solid.material == 1]
    assert len(of_gum) and of_gum[:, 2].max() < -4.9
    _, normal, height, material = solid.planes(np.array([[4.9, 0, 0]]), np.eye(3), np.zeros(3))
    np.testing.assert_allclose(normal, [[1, 0, 0]], atol=1e-9)
    assert height == pytest.approx([-0.1], abs=1e-6) and material.tolist() == [0]


def test_nothing_touches_at_rest(reference_model):
    x = rest_state(reference_model).positions
    pose = pose_of(reference_model, control(reference_model, Pose()))
    for planes in surfaces_of(reference_model, pose, x).values():
        assert row_depths(planes, x).max(initial=0) < 1e-9
    np.testing.assert_array_equal(cleared(reference_model, pose, x), x)


def test_a_way_out_that_leads_deeper_in_is_not_taken(reference_model, monkeypatch):
    x = rest_state(reference_model).positions
    pose = pose_of(reference_model, control(reference_model, Pose()))
    inward = np.zeros((reference_model.count, 3))
    inward[reference_model.contacts.lip_lower] = [0, 0, 0.5]
    monkeypatch.setattr("headshop.sim.tissue.clearing.way_out", lambda planes, positions, free: inward)
    np.testing.assert_array_equal(cleared(reference_model, pose, x), x)


@pytest.fixture(scope="module")
def ruler(reference, reference_model):
    return Ruler(reference, reference_model, pose_of(reference_model, control(reference_model, Pose())))


@pytest.mark.parametrize("name", SHOWN)
def test_poses_tell_that_they_came_out_clear(solved, name):
    found = solved[name].diagnostics
    assert found["penetration_of"].keys() == set(PAIRS)
    assert max(found["penetration_of"].values()) == found["penetration_mm"] < 0.1


@pytest.mark.parametrize("pair", WORST, ids="+".join)
def test_poses_come_out_clear(reference_model, ruler, pair):
    """As the meshes themselves tell it, not the solver's own points and planes."""
    shapes = poses()
    one, other = (combined(shapes[name], shapes[over()[name]]) if name in over() else shapes[name] for name in pair)
    asked = control(reference_model, combined(one, other))
    solution = solve(reference_model, asked, max_iterations=200)
    depth = ruler(solution.state.positions, pose_of(reference_model, asked))
    assert depth.keys() == set(NAMES) and max(depth.values()) < 0.1
    assert solution.converged and solution.diagnostics["penetration_mm"] < 0.1


def test_the_ruler_sees_what_is_in_what(reference, reference_model, ruler):
    n = reference_model.count
    rest = rest_state(reference_model).positions
    pose = pose_of(reference_model, control(reference_model, Pose()))
    assert max(ruler(rest, pose).values()) < 1e-6

    def moved(rows, by):
        x = rest.copy()
        x[rows] += by
        return ruler(x, pose)

    lids = reference_model.lids[0]
    away = rest[lids.column] - lids.eye.centre
    found = moved(lids.column, -0.5 * away / np.linalg.norm(away, axis=1, keepdims=True))
    assert 0.3 < found["lid_eyeball"] < 0.6 and found["lip_lip"] < 1e-6
    upper, lower = (np.asarray(reference.groups[name]) > 0.3 for name in ("lip_upper", "lip_lower"))
    found = moved(np.flatnonzero(lower & ~upper), [0, 0, 0.6])
    assert 0.3 < found["lip_lip"] < 0.61
    assert moved(np.flatnonzero(upper | lower), [0, 4.0, 0])["skin_teeth"] > 0.5
    on_bone = np.flatnonzero(reference_model.layers.bony)
    assert moved(n + on_bone, 1.2 * (rest[2 * n + on_bone] - rest[n + on_bone]))["fascia_skull"] > 0.5


def test_normals_are_those_of_what_is_drawn(reference, solved):
    skin, faces = solved["mouthRollUpper"].state.skin, reference.skin.faces
    samples = drawn_samples(faces, reference.skin.vertices, np.asarray(reference.groups["lip_upper"]) > 0.5, fans=True)
    rows, quads = smoother(faces, len(skin), 2)
    fine = rows @ skin
    normals = vertex_normals(fine, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    some = samples[samples.at(skin)[:, 0] > 0]
    at = some.at(skin)
    away, near = cKDTree(fine).query(at)
    agree = np.einsum("ij,ij->i", some.fan.normals(at, skin), normals[near])
    assert len(at) > 100 and away.max() < 0.05 and np.median(agree) > 0.999 and (agree > 0.9).mean() > 0.98


def test_volume_is_told_by_region(reference_model, solved):
    volume = reference_model.prism_volume
    share = np.bincount(reference_model.region, volume, minlength=len(REGIONS)) / volume.sum()
    assert len(REGIONS) == 8 and (share > 0.003).all() and share[-1] < 0.65
    found = solved["eyeBlinkLeft"].diagnostics
    of = found["volume_drift_of"]
    assert of.keys() == set(REGIONS) and abs(of["chin"]) < 1e-3 < abs(of["lids"])
    assert sum(share[k] * of[name] for k, name in enumerate(REGIONS)) == pytest.approx(found["volume_drift"], abs=1e-9)
    assert all(abs(s.diagnostics["volume_drift"]) < 0.02 for s in solved.values())


def test_the_drawn_lids_lie_on_the_ball(reference_model, reference, solved):
    """All of the limit surface near the eye, not only where the solver looks."""
    rows = smoother(reference.skin.faces, reference_model.count, 2)[0]
    for lids in reference_model.lids:
        points = rows @ solved["eyeBlinkLeft"].state.skin
        points = points[np.linalg.norm(points - lids.eye.centre, axis=1) < lids.eye.radius + 2]
        gap = np.linalg.norm(points - lids.eye.centre, axis=1) - eyeball_radius(lids, points, np.zeros(2))
        assert gap.min() > -0.1


def test_no_tooth_is_in_a_rolled_lip(reference_model, reference, solved):
    lips = np.maximum(reference.groups["lip_upper"], reference.groups["lip_lower"])
    rows = smoother(reference.skin.faces, reference_model.count)[0]
    points = (rows @ solved["mouthRollUpper"].state.skin)[rows @ lips > 0.5]
    for part in ("teeth_upper", "teeth_lower"):
        mesh = reference.parts[part]
        lost = points[inside(points, mesh.vertices, mesh.triangles)]
        assert len(lost) < 4 and all(
            np.linalg.norm(mesh.vertices[mesh.triangles].mean(axis=1) - p, axis=1).min() < 1.5 for p in lost
        )


def test_gums_take_their_lining_along(reference_model, reference):
    held, below = attached(reference)
    rest = reference.skin.vertices
    asked = control(reference_model, Pose(jaw_open=0.7))
    moved = solve(reference_model, asked, max_iterations=200).state.skin
    pose = pose_of(reference_model, asked)
    firm = held > 0.99
    assert firm.sum() > 40 and 0 < below[firm].mean() < 1
    goal = np.where(below[:, None] > 0, rest @ pose.rotation.T + pose.translation, rest)
    away = np.linalg.norm(moved - goal, axis=1)[firm]
    assert away.max() < 1 and np.median(away) < 0.1


def test_flesh_stays_between_skin_and_lining(reference_model, monkeypatch):
    """A jaw opened as far as it goes draws the lips thin over the teeth."""
    wide = control(reference_model, Pose(jaw_open=1.0))
    flesh = reference_model.drawn.flesh

    def thin(skin):
        normals = vertex_normals(skin, reference_model.contacts.triangles)
        facing = flesh.outer.at(normals) - flesh.inner.at(normals)
        facing /= np.linalg.norm(facing, axis=1, keepdims=True)
        apart = np.einsum("ij,ij->i", flesh.outer.at(skin) - flesh.inner.at(skin), facing)
        return apart / np.linalg.norm(flesh.outer.at(rest) - flesh.inner.at(rest), axis=1)

    rest = rest_state(reference_model).skin
    assert len(flesh.least) > 400 and thin(rest).min() > 0.7
    frames = Frames(reference_model)
    shown, whole = frames.follow(wide, 200, 0.005).skin, frames.cleared().skin
    unheeded = np.zeros((0, 3), np.int32), np.zeros((0, 3)), np.zeros(0)
    monkeypatch.setattr("headshop.sim.tissue.frames.flesh_contacts", lambda *arguments: unheeded)
    without = Frames(reference_model).follow(wide, 200, 0.005).skin
    assert (thin(without) < 0.27).sum() > 5 and thin(whole).min() > 0.27
    assert (thin(shown) < 0.27).sum() < 0.5 * (thin(without) < 0.27).sum()


def test_lids_go_a_little_with_a_sideways_gaze(reference_model, reference):
    """The cornea carries their middle along; the corners of the eye stay."""
    moved = solve(reference_model, control(reference_model, Pose(gaze_x=1.0))).state.skin - reference.skin.vertices
    at = {
        name: moved[np.linalg.norm(reference.skin.vertices - p, axis=1).argmin()]
        for name, p in reference.landmark_positions().items()
    }
    for side in "lr":
        assert 0.4 < at[f"ps_{side}"][0] < 2.5 and 0.2 < at[f"pi_{side}"][0] < 2.5
        assert abs(at[f"en_{side}"][0]) < 0.4 and abs(at[f"ex_{side}"][0]) < 0.4


def test_shut_lids_meet_where_they_are_drawn(reference_model, monkeypatch):
    both = control(reference_model, pose_from({"blink_l": 1.0, "blink_r": 1.0}))
    skin = solve(reference_model, both).state.skin
    monkeypatch.setattr("headshop.sim.tissue.frames.met", lambda model, shut, positions: positions)
    held = Frames(reference_model).follow(both, 150, 0.005).skin
    for lids in reference_model.lids:

        def gap(of, lids=lids):
            between = lids.edge.gap(of, lids.upper, lids.within)[lids.opening > 0.02]
            return lids.eye.radius * between.max()

        assert gap(skin) < 0.05
        assert gap(held) > 0.2  # what the tissue holds them apart
