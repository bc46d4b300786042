# SPDX-License-Identifier: GPL-3.0-or-later
"""Waters' muscles on the reference head: each as strong as the table says, lips told apart, both sides alike."""

import numpy as np
import pytest

from headshop.sim.acting.expressions import expressions, for_head
from headshop.sim.acting.pose import Pose, control
from headshop.sim.muscle.model import build_model
from headshop.sim.muscle.solver import displaced, resultant, solve
from headshop.sim.tissue.model import strengths
from headshop.sim.tissue.muscle_field import JAW_MUSCLES, LID_MUSCLES, base_name


@pytest.fixture(scope="module")
def model(reference):
    return build_model(reference)


@pytest.fixture(scope="module")
def moved(model):
    """Pose -> displacements (n, 3) of the skin."""
    return lambda pose: displaced(model, control(model, pose)) - model.skin


def at(reference, motion, name):
    """Motion of a landmark, mm."""
    marks = reference.landmarks
    k = marks.names.index(name)
    return marks.weights[k] @ motion[marks.corners[k]]


def acting_muscles(model):
    return [n for n in model.muscle_names if base_name(n) not in (*JAW_MUSCLES, *LID_MUSCLES)]


def test_every_muscle_goes_as_far_as_the_table_says(model, reference, moved):
    seen = np.asarray(reference.groups["inner"]) < 0.5
    for name in acting_muscles(model):
        goal = strengths()[base_name(name)]["excursion_mm"]
        peak = np.linalg.norm(moved(Pose({name: 1.0})), axis=1)[seen].max()
        # what presses on bone slides along it instead, which may be the peak
        assert 0.6 * goal < peak < 1.05 * goal, (name, peak, goal)


def test_half_a_contraction_goes_half_as_far(model):
    for k, name in enumerate(model.muscle_names):
        tension = np.zeros(len(model.muscle_names))
        tension[k] = 1.0
        whole, half = (resultant(model, model.skin, t, np.eye(3), np.zeros(3)) for t in (tension, tension / 2))
        assert half == pytest.approx(whole / 2, abs=1e-9) and whole.any() == (name in acting_muscles(model))


def test_muscles_move_the_lip_that_they_end_in(reference, moved):
    for name, lip, other, sign in (
        ("levator_labii_superioris", "ls", "li", 1),
        ("depressor_labii_inferioris", "li", "ls", -1),
    ):
        motion = moved(Pose({f"{name}_{side}": 1.0 for side in "lr"}))
        assert sign * at(reference, motion, lip)[2] > 1 and abs(at(reference, motion, other)[2]) < 0.3


def test_muscles_of_the_face_leave_scalp_and_ears_alone(reference, moved):
    motion = np.linalg.norm(moved(for_head(expressions()["joy"], {m.name for m in reference.muscles})), axis=1)
    for group in ("scalp", "ear_l", "ear_r"):
        assert motion[np.asarray(reference.groups[group]) > 0.9].max() < 0.01


def test_corners_of_the_mouth_go_half_the_way_of_the_jaw(reference, moved):
    motion = moved(Pose(jaw_open=0.5))
    chin, corner = at(reference, motion, "pg"), at(reference, motion, "ch_l")
    assert 0.35 < np.linalg.norm(corner) / np.linalg.norm(chin) < 0.6
    assert np.linalg.norm(at(reference, motion, "ls")) < 0.5


def test_what_is_inside_follows_the_lips(reference, moved):
    motion = moved(Pose({f"zygomaticus_major_{side}": 1.0 for side in "lr"}))
    inner = np.asarray(reference.groups["inner"]) > 0.5
    length = np.linalg.norm(motion, axis=1)
    # across every edge between outside and inside the motion goes on
    faces = reference.skin.faces
    pairs = np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])
    pairs = pairs[(pairs >= 0).all(axis=1)]
    border = pairs[inner[pairs[:, 0]] != inner[pairs[:, 1]]]
    jump = np.linalg.norm(motion[border[:, 0]] - motion[border[:, 1]], axis=1)
    assert length[border].max() > 8 and jump.max() < 2.5


@pytest.mark.parametrize("name", ["smile", "fear", "pucker"])
def test_left_and_right_mirror(model, reference, moved, name):
    pose = for_head(expressions()[name], model.muscle_names)
    one = {k: v for k, v in pose.muscles.items() if not k.endswith("_r")}
    other = {k[:-2] + "_r" if k.endswith("_l") else k: v for k, v in one.items()}
    left, right = (model.skin + moved(Pose(m, jaw_open=pose.jaw_open)) for m in (one, other))
    mirrored = right * [-1, 1, 1]
    rest = model.skin * [-1, 1, 1]
    order, back = (np.lexsort(np.round(x, 2).T) for x in (model.skin, rest))
    assert np.abs(model.skin[order] - rest[back]).max() < 0.05
    assert np.abs(left[order] - mirrored[back]).max() < 0.1


@pytest.mark.parametrize("name", list(expressions()))
def test_expressions_stay_out_of_eyes_and_teeth(model, name):
    found = solve(model, control(model, for_head(expressions()[name], model.muscle_names))).diagnostics
    assert found["peak_mm"] < 62 and abs(found["volume_drift"]) < 0.03 and found["penetration_mm"] < 1
