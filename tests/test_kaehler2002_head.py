# SPDX-License-Identifier: GPL-3.0-or-later
"""The model of Kähler et al. 2002 on whole heads: rest, muscles, jaw, lids, bone, motion in time."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.errors import InputError
from headshop.sim.relax.responses import mirrored_vertices
from headshop.sim.tissue.contact import bone_planes
from headshop.sim.tissue.eye_surface import eyeball_radius
from headshop.sim.tissue.jaw import jaw_transform
from headshop.sim.tissue.kaehler2002.leapfrog import DivergedError
from headshop.sim.tissue.kaehler2002.model import build_model
from headshop.sim.tissue.kaehler2002.posed import muscle_shapes, pose_of
from headshop.sim.tissue.kaehler2002.solver import rest_state, solve, step
from headshop.sim.tissue.planes import depths

LOOSE = 0.1  # mm, where a test asks for centimetres


@pytest.fixture(scope="module")
def model(reference):
    return build_model(reference)


def _at(reference, motion, name):
    marks = reference.landmarks
    k = marks.names.index(name)
    return marks.weights[k] @ motion[marks.corners[k]]


def _motion(model, pose, tolerance=LOOSE):
    return solve(model, control(model, pose), tolerance=tolerance).state.skin - model.rest[: model.count]


def _row(model, name):
    return list(model.axes.muscles).index(model.muscle_names.index(name))


def test_neutral_is_exactly_the_scan_and_stays_so_in_time(model, reference):
    asked = control(model, Pose())
    solution = solve(model, asked)
    assert solution.converged and solution.diagnostics["energy"] < 1e-12
    assert np.abs(solution.state.skin - reference.skin.vertices).max() < 1e-9
    later = step(model, rest_state(model), asked, 1 / 100)
    assert np.abs(later.skin - reference.skin.vertices).max() < 1e-9 and np.abs(later.velocities).max() < 1e-6


def test_muscles_that_meet_at_the_corner_of_the_mouth_share_one_node(model):
    def tip(name):
        return model.axes.node[np.flatnonzero(model.axes.muscle == _row(model, name))[-1]]

    meet = ("zygomaticus_major", "levator_anguli_oris", "risorius", "depressor_anguli_oris", "buccinator")
    assert len({tip(f"{name}_l") for name in meet} | {tip("orbicularis_oris_upper")}) == 1
    assert tip("zygomaticus_major_r") != tip("zygomaticus_major_l") >= 0


def test_a_smile_mirrors_and_drags_the_merged_muscles(model, reference):
    motion = _motion(model, Pose({"zygomaticus_major_l": 1.0, "zygomaticus_major_r": 1.0}), 0.02)
    assert motion == pytest.approx(motion[mirrored_vertices(reference.skin.vertices)] * [-1, 1, 1], abs=0.1)
    left = _at(reference, motion, "ch_l")
    assert left[2] > 3 and left[0] > 1 and left[1] > 1
    contraction = np.zeros(len(model.axes.muscles))
    contraction[_row(model, "zygomaticus_major_l")] = 1.0
    before, now, _, ratio = muscle_shapes(model, np.eye(3), np.zeros(3), contraction)
    moved = np.linalg.norm(now - before, axis=1)
    for name, shorter in (("zygomaticus_major_l", True), ("depressor_anguli_oris_l", False)):
        rows = model.fibres.muscle == _row(model, name)
        assert moved[rows].max() > 5 and (ratio[rows].mean() < 1) == shorter
    assert moved[model.fibres.muscle == _row(model, "risorius_r")].max() < 0.5


def test_brows_rise_and_lips_protrude_with_their_centre(model, reference):
    up = Pose({f"frontalis_{k}_{s}": 1.0 for k in ("inner", "major", "outer") for s in "lr"})
    assert _at(reference, _motion(model, up), "sci_l")[2] > 4
    pout = {"orbicularis_oris_upper": 1.0, "orbicularis_oris_lower": 1.0}
    asked = control(model, Pose(pout))
    forward, back = (
        solve(model, replace(asked, lips=np.full(2, way)), tolerance=LOOSE).state.skin - model.rest[: model.count]
        for way in (0.5, -1.0)
    )
    for name in ("ls", "li"):
        assert _at(reference, forward, name)[1] < -3 < _at(reference, back, name)[1] - 1
    assert _at(reference, forward, "ch_l")[0] < -1.5 < 1.5 < _at(reference, forward, "ch_r")[0]


def test_the_jaw_carries_skin_and_muscles_and_the_upper_lip_stays(model, reference):
    asked = control(model, Pose(jaw_open=0.6))
    motion = _motion(model, Pose(jaw_open=0.6))
    assert _at(reference, motion, "li")[2] < -10 and _at(reference, motion, "pg")[2] < -12
    assert abs(_at(reference, motion, "ls")[2]) < 3
    rotation, translation = jaw_transform(model.jaw, *asked.jaw)
    rows = np.flatnonzero((model.fibres.muscle == _row(model, "depressor_anguli_oris_l")) & model.fibres.start)
    root = model.fibres.points[rows]
    assert pose_of(model, asked).fibres[rows] == pytest.approx(root @ rotation.T + translation, abs=1e-6)


def test_a_blink_closes_the_eye_and_stays_outside_the_ball(model, reference):
    solution = solve(model, control(model, Pose(blink_l=1.0)), tolerance=LOOSE)
    marks, rest = reference.landmarks.on({"skin": solution.state.skin}), reference.landmark_positions()
    assert abs(marks["ps_l"][2] - marks["pi_l"][2]) < 1.5 < 5 < rest["ps_l"][2] - rest["pi_l"][2]
    for lids in model.lids:
        points = solution.state.skin[lids.contact_column]
        gap = np.linalg.norm(points - lids.eye.centre, axis=1) - eyeball_radius(lids, points, np.zeros(2))
        assert (gap > np.minimum(lids.clearance, 0) - 0.05).all()


@pytest.mark.parametrize(("name", "goal"), [("frontalis_major_l", 9.0), ("depressor_labii_inferioris_r", 7.0)])
def test_full_contraction_moves_what_the_table_says(model, name, goal):
    assert np.linalg.norm(_motion(model, Pose({name: 1.0})), axis=1).max() == pytest.approx(goal, rel=0.1)


def test_a_head_without_muscles_and_numbers_that_are_none_are_named(model, reference):
    with pytest.raises(InputError, match="no muscle that moves skin"):
        build_model(replace(reference, muscles=()))
    asked = control(model, Pose())
    asked.activations[:] = np.nan
    with pytest.raises(DivergedError, match="left the finite numbers"):
        solve(model, asked)


@pytest.mark.parametrize("seed", [0, 1])
def test_any_contraction_comes_to_rest_outside_the_bone(model, seed):
    rng = np.random.default_rng(seed)
    values = rng.uniform(size=len(model.muscle_names)) * (rng.uniform(size=len(model.muscle_names)) < 0.4)
    asked = replace(control(model, Pose(jaw_open=float(seed) * 0.7)), activations=values)
    solution = solve(model, asked, tolerance=LOOSE)
    assert solution.converged and np.isfinite(solution.state.positions).all()
    assert solution.diagnostics["bone_penetration_mm"] < 0.1 and solution.diagnostics["penetration_mm"] < 0.1
    # and outside the real bone, not only the planes the model keeps of it
    turn = jaw_transform(model.jaw, *asked.jaw)
    planes = bone_planes(model.contacts.bones, model.layers, solution.state.skin, *turn)
    planes = replace(planes, node=planes.node - model.count)
    assert depths(planes, solution.state.skin).max() < 0.4


def test_in_time_the_skin_goes_to_where_rest_is(model):
    asked = control(model, Pose({"zygomaticus_major_l": 0.5}))
    goal = solve(model, asked, tolerance=LOOSE).state.skin
    state = rest_state(model)
    away = [np.abs(state.skin - goal).max()]
    for _ in range(4):
        state = step(model, state, asked, 1 / 30)
        away.append(np.abs(state.skin - goal).max())
    assert away[0] > 3 and away[-1] < 0.5 * away[0]
