# SPDX-License-Identifier: GPL-3.0-or-later
"""The ARKit shapes: all of Apple's names, mirrored, of muscles there are; and the controls that came with them."""

import numpy as np
import pytest

from headshop.sim.acting import arkit
from headshop.sim.acting.pose import Pose, combined, control
from headshop.sim.mesh import vertex_normals
from headshop.sim.tissue.posing import posed_parts
from headshop.sim.tissue.solver import solve

SIDED = (
    "browDown browOuterUp cheekSquint eyeBlink eyeLookDown eyeLookIn eyeLookOut eyeLookUp eyeSquint eyeWide "
    "mouthDimple mouthFrown mouthLowerDown mouthPress mouthSmile mouthStretch mouthUpperUp noseSneer"
).split()
WHOLE = (
    "browInnerUp cheekPuff jawForward jawLeft jawOpen jawRight mouthClose mouthFunnel mouthLeft mouthPucker mouthRight "
    "mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper tongueOut"
).split()


@pytest.fixture(scope="module")
def moved(reference_model, reference):
    """Pose -> motion (n, 3) mm of the skin."""
    return lambda pose: solve(reference_model, control(reference_model, pose)).state.skin - reference.skin.vertices


def gap(reference_model, reference, motion):
    """mm by which the points of the lips that touch at rest have come apart, in the mean."""
    skin, seal = reference.skin.vertices + motion, reference_model.seal
    return np.linalg.norm(skin[seal.lower] - skin[seal.upper] - seal.offset, axis=1).mean()


def test_all_shapes_of_apple_and_no_others(reference):
    names = {name + side for name in SIDED for side in ("Left", "Right")} | set(WHOLE)
    poses = arkit.poses()
    assert set(poses) == names and len(names) == 52
    known = {muscle.name for muscle in reference.muscles}
    for name, pose in poses.items():
        assert set(pose.muscles) <= known, name
        assert any(pose.values().values()), name  # none is empty
        assert all(-1 <= value <= 1 for value in pose.values().values()), name
    assert set(arkit.over()) | set(arkit.over().values()) <= names


def test_right_shapes_mirror_the_left_ones(reference_model, reference, moved):
    poses = arkit.poses()
    assert poses["jawRight"].jaw_side == -poses["jawLeft"].jaw_side != 0
    assert poses["eyeLookInRight"].gaze_r_x == -poses["eyeLookInLeft"].gaze_l_x != 0
    assert "zygomaticus_major_r" in poses["mouthSmileRight"].muscles
    left, right = (moved(poses[f"mouthPress{side}"]) for side in ("Left", "Right"))
    place = reference.skin.vertices * [-1, 1, 1]
    twin = np.linalg.norm(place[:, None] - reference.skin.vertices[None], axis=2).argmin(axis=1)
    assert np.abs(left - right[twin] * [-1, 1, 1]).max() < 0.1


def test_lips_are_held_together_over_an_open_jaw(reference_model, reference, moved):
    opened = Pose(jaw_open=0.6)
    apart, held = (
        gap(reference_model, reference, moved(pose)) for pose in (opened, combined(opened, Pose(lips_together=1.0)))
    )
    assert apart > 12 and held < 1


def test_lips_together_move_nothing_at_rest(moved):
    assert np.abs(moved(Pose(lips_together=1.0))).max() < 1e-6


def test_the_sphincter_pushes_out_or_draws_in(reference, moved):
    lip = reference.landmarks
    k = lip.names.index("li")

    def forward(place):
        motion = moved(Pose({"orbicularis_oris_lower": 1.0}, lip_lower_forward=place))
        return -(lip.weights[k] @ motion[lip.corners[k]])[1]

    back, usual, ahead = (forward(place) for place in (-1.0, 0.0, 1.0))
    assert back < -0.5 and usual > 2 and ahead > usual + 0.5


def test_air_puffs_and_sucks_the_cheeks(reference, moved):
    cheek = np.maximum(reference.groups["cheek_l"], reference.groups["cheek_r"]) > 0.8
    normal = vertex_normals(reference.skin.vertices, reference.skin.triangles)
    out, into = ((moved(Pose(cheek_puff=air)) * normal).sum(axis=1)[cheek].mean() for air in (1.0, -1.0))
    assert out > 2 and into < -0.5


def test_one_eye_turns_alone(reference_model, reference):
    asked = control(reference_model, Pose(gaze_l_z=-1.0))
    parts = posed_parts(reference_model, solve(reference_model, asked).state, asked)
    assert parts["eye_r"] == pytest.approx(reference.parts["eye_r"].vertices, abs=1e-9)
    assert np.abs(parts["eye_l"] - reference.parts["eye_l"].vertices).max() > 2
    motion = parts["skin"] - reference.skin.vertices
    left, right = (np.linalg.norm(motion[reference.groups[f"lid_upper_{s}"] > 0.5], axis=1).max() for s in "lr")
    assert left > 2 and right < 0.1


def test_the_tongue_comes_out_over_the_lower_teeth(reference_model, reference):
    asked = control(reference_model, arkit.poses()["tongueOut"])
    parts = posed_parts(reference_model, solve(reference_model, asked).state, asked)
    tip = parts["tongue"][np.argmin(parts["tongue"][:, 1])]
    assert tip[1] < parts["skin"][:, 1][reference.groups["lip_lower"] > 0.5].min()  # in front of the lip
    teeth = parts["teeth_lower"][np.abs(parts["teeth_lower"][:, 0]) < 6]
    over = parts["tongue"][np.abs(parts["tongue"][:, 1] - teeth[np.argmax(teeth[:, 2]), 1]) < 1.0]
    assert over[:, 2].min() > teeth[:, 2].max() - 1.0
