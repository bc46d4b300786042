# SPDX-License-Identifier: GPL-3.0-or-later
from types import SimpleNamespace

import numpy as np
import pytest

from headshop.sim.acting.expressions import BASIC, expressions, for_head, muscle_poses
from headshop.sim.acting.pose import CONTROLS, GAZE_REACH, Pose, control, pose_from
from headshop.sim.errors import InputError

NAMES = (
    *("zygomaticus_major_l", "digastricus_l", "digastricus_r", "masseter_l", "masseter_r"),
    *("pterygoideus_lateralis_l", "pterygoideus_lateralis_r", "levator_palpebrae_l", "orbicularis_oculi_palpebral_l"),
)


@pytest.fixture
def model():
    return SimpleNamespace(muscle_names=NAMES)


def test_activations_are_placed_and_clipped(model):
    asked = control(model, Pose({"zygomaticus_major_l": 1.7, "masseter_l": -0.2}))
    assert asked.activations[NAMES.index("zygomaticus_major_l")] == 1.0
    assert asked.activations.sum() == 1.0 and np.allclose(asked.jaw, 0, atol=0.05)


def test_unknown_muscle_is_named(model):
    with pytest.raises(InputError, match="smile_muscle"):
        control(model, Pose({"smile_muscle": 1.0}))


@pytest.mark.parametrize("pose", [Pose({"masseter_l": float("nan")}), Pose(jaw_open=float("inf"))])
def test_what_is_no_number_is_named(model, pose):
    with pytest.raises(InputError, match="'masseter_l' to nan|'jaw_open' to inf"):
        control(model, pose)


@pytest.mark.parametrize("value", ["1", None, [0.5, 1.0], np.array([0.5, 1.0]), 10**400])
def test_what_is_not_even_like_a_number_is_named(model, value):
    for pose in (lambda: Pose({"zygomaticus_major_l": value}), lambda: Pose(jaw_open=value)):
        with pytest.raises(InputError, match="finite number"):
            control(model, pose())
    with pytest.raises(InputError, match="'jaw_open' to"):
        pose_from({"jaw_open": value})


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("zygomaticus_major", "did you mean 'zygomaticus_major_l'"),
        ("Jaw_Open", "did you mean 'jaw_open'"),
        ("jaw_open", "a control, not a muscle"),
        ("smile", "correct the name or leave it out"),
    ],
)
def test_a_name_that_is_nearly_right_is_told(model, name, words):
    with pytest.raises(InputError, match=words):
        control(model, Pose({name: 1.0}))


def test_muscles_are_named():
    with pytest.raises(InputError, match="dict of names"):
        Pose(["zygomaticus_major_l"])


def test_jaw_muscles_move_the_jaw(model):
    both = {"digastricus_l": 1.0, "digastricus_r": 1.0}
    opened = control(model, Pose(both)).jaw[0]
    held = control(model, Pose({**both, "masseter_l": 1.0, "masseter_r": 1.0})).jaw[0]
    assert opened > 0.3 and 0 < held < opened
    assert control(model, Pose({"pterygoideus_lateralis_l": 1.0})).jaw[2] < -0.3  # one side pushes to the other


def test_lids_blink_squint_and_widen(model):
    assert control(model, Pose(blink_l=1.0)).lids.tolist() == [[1, 1], [0, 0]]
    assert control(model, Pose({"levator_palpebrae_l": 1.0})).lids[0, 0] < 0
    assert control(model, Pose({"orbicularis_oculi_palpebral_l": 1.0})).lids[0, 1] > 1
    assert control(model, Pose({"levator_palpebrae_l": 1.0}, blink_l=1.0)).lids[0, 0] == 1.0  # a blink wins


def test_gaze_reaches(model):
    assert control(model, Pose(gaze_x=-2.0, gaze_z=1.0)).gaze == pytest.approx(GAZE_REACH * [-1, 1])


def test_values_round_trip():
    pose = Pose({"masseter_l": 0.3}, jaw_open=0.2, gaze_z=-0.1)
    assert set(pose.values()) == {"masseter_l", *CONTROLS}
    assert pose_from(pose.values()) == pose


def test_table_of_expressions_fits_the_reference_head(reference):
    table = expressions()
    assert set(BASIC) | {"smile", "frown", "jaw_open", "pucker", "blink"} <= set(table)
    names = {m.name for m in reference.muscles}
    for name, pose in table.items():
        assert set(pose.muscles) <= names, name
        assert all(0 <= v <= 1 for v in pose.muscles.values()) and -1 <= pose.gaze_z <= 1
        assert for_head(pose, names) == pose and for_head(pose, ()).muscles == {}
    assert list(muscle_poses(reference)) == [m.name for m in reference.muscles]
    assert all(pose.muscles == {name: 1.0} for name, pose in muscle_poses(reference).items())
