# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig: forces by hand, the jaw's frame there and back, and a patch of skin learnt from its simulation."""

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.errors import InputError
from headshop.sim.progress import finish
from headshop.sim.response import actor, fit, mirror, mixtures, sampling, storage
from headshop.sim.response.accuracy import errors, plays_of, summary
from headshop.sim.response.inputs import input_names, inputs_of
from headshop.sim.response.jaw_frame import JawFrame
from headshop.sim.response.spending import Spending, fit_spending
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve

MUSCLE = "zygomaticus_major_l"


def test_a_spent_muscle_by_hand():
    """b = a (1 - 2 b) gives b = a / (1 + 2 a); a mate that has done the work leaves less, an antagonist more."""
    alone = Spending(np.array([[2.0]]), np.zeros((1, 0)))
    force, progress = alone.forces(np.array([0.5]), np.zeros(0))
    assert force == pytest.approx(0.25) and progress == pytest.approx(0.5)
    for mutual, expected in ((1.0, 1 / 3), (-1.0, 1.0)):
        pair = Spending(np.array([[1.0, mutual], [mutual, 1.0]]), np.zeros((2, 0)))
        force, _ = pair.forces(np.ones(2), np.zeros(0))
        np.testing.assert_allclose(force, expected)
    beside = Spending(np.array([[0.0]]), np.array([[0.4, -0.4]]))
    np.testing.assert_allclose(beside.forces(np.ones(1), np.array([0.5, 1.0]))[0], 1.2)
    np.testing.assert_allclose(beside.forces(np.ones(1), np.array([5.0, 0.0]))[0], 0.0)  # spent, not pushing


def test_spending_is_found_again():
    rng = np.random.default_rng(0)
    truth = Spending(np.eye(4) + 0.5 * rng.uniform(-1, 1, (4, 4)), 0.3 * rng.uniform(-1, 1, (4, 2)))
    activations, others = rng.uniform(0, 1, (300, 4)), rng.uniform(-1, 1, (300, 2))
    force, progress = truth.forces(activations, others)
    whole = (force > 0).all(axis=1)  # the model is linear as long as no muscle hangs loose
    found = fit_spending(activations[whole], others[whole], progress[whole], (force / activations)[whole])
    np.testing.assert_allclose(found.mutual, truth.mutual, atol=0.02)
    np.testing.assert_allclose(found.beside, truth.beside, atol=0.02)


def test_the_jaws_frame_there_and_back(reference):
    frame = JawFrame(reference.skin.vertices, np.asarray(reference.groups["jaw"], float), reference.jaw)
    rng = np.random.default_rng(1)
    own = rng.normal(size=frame.rest.shape)
    for jaw in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.4, 0.7, -1.0)):
        np.testing.assert_allclose(frame.own(frame.placed(own, jaw), jaw), own, atol=1e-9)
    np.testing.assert_array_equal(frame.placed(0 * own, (0, 0, 0)), frame.rest)
    rigid = JawFrame(frame.rest, np.ones(len(own)), frame.jaw).placed(own, (0.8, 0.0, 0.3))
    sides = np.linalg.norm(rigid[1:] - rigid[:-1], axis=1)  # what is all jaw moves as one piece
    np.testing.assert_allclose(sides, np.linalg.norm(np.diff(frame.rest + own, axis=0), axis=1), atol=1e-9)


def test_inputs_leave_out_what_moves_no_skin(reference_model):
    names = reference_model.muscle_names
    labels = input_names(names)

    def of(**values):
        muscles = {k: v for k, v in values.items() if k in names}
        pose = Pose(muscles, **{k: v for k, v in values.items() if k not in names})
        return dict(zip(labels, inputs_of(names, control(reference_model, pose)), strict=True))

    assert not any(of().values())
    assert not any(of(lip_upper_forward=1.0).values())  # a centre of a sphincter at rest
    assert of(lip_upper_forward=1.0, orbicularis_oris_upper=0.5)["lip_upper_forward"] == 0.5
    opened = of(digastricus_l=1.0, digastricus_r=1.0)
    assert opened["jaw_open"] == pytest.approx(0.45) and "digastricus_l" not in opened
    assert of(gaze_x=1.0, gaze_l_x=-1.0)["gaze_l_x"] == 0.0


@pytest.fixture(scope="module")
def patch(flat_patch):
    """A flat patch with one muscle: head, model and the rig learnt from eight of its contractions."""
    head = flat_patch(13, 60.0)
    model = build_model(head)
    poses = [Pose({MUSCLE: 1.0})] + [Pose({MUSCLE: value}) for value in np.linspace(0.08, 0.92, 7)]
    samples = finish(sampling.sampled(model, poses, max_iterations=100, tolerance=1e-4))
    return head, model, finish(fit.fit_rig(model, samples, 1)), samples


def test_unseen_contractions_of_a_patch(patch):
    head, model, rig, _ = patch
    unseen = [Pose({MUSCLE: value}) for value in (0.15, 0.43, 0.7)]
    (off,) = finish(errors(model, unseen, *plays_of(rig)))
    moved = solve(model, control(model, unseen[-1])).state.skin - head.skin.vertices
    assert np.abs(moved).max() > 5  # it was not rest that was learnt
    assert summary(off)["rms_mm"] < 0.02 and summary(off)["max_mm"] < 0.2, summary(off)
    np.testing.assert_array_equal(rig.skin(control(model, Pose())), head.skin.vertices)


def test_a_rig_plays_one_pose_as_it_plays_many(patch):
    """At the samples themselves, one by one and all at once, the regression says what the simulation said."""
    _, model, rig, samples = patch
    many = rig.own(samples.inputs)
    for number, row in enumerate(samples.inputs):
        np.testing.assert_allclose(rig.own(row[None])[0], many[number], atol=1e-4)
    np.testing.assert_allclose(rig.frame.rest + many, samples.skin, atol=0.1)


def test_crowds_are_among_the_samples(reference_model):
    """All muscles at once, the jaw anywhere in about half of them."""
    names = reference_model.muscle_names
    poses = sampling.drawn_poses(names, 140, np.random.default_rng(3))[len(sampling.single_poses(names)) :]
    skin = set(input_names(names)) & set(names)
    crowds = [pose for pose in poses if all(pose.values().get(name) for name in skin)]
    assert len(crowds) >= 60
    opened = sum(bool(pose.values().get("jaw_open")) for pose in crowds)
    assert 0.3 < opened / len(crowds) < 0.7


def test_a_rig_is_kept_as_bytes(patch):
    head, model, rig, samples = patch
    data = storage.to_bytes(rig, {"one": {"rms_mm": 0.01}})
    assert data == storage.to_bytes(finish(fit.fit_rig(model, samples, 1)), {"one": {"rms_mm": 0.01}})
    again, measured = storage.from_bytes(data, head)
    asked = control(model, Pose({MUSCLE: 0.6}))
    np.testing.assert_allclose(again.skin(asked), rig.skin(asked), atol=1e-5)
    assert measured == {"one": {"rms_mm": 0.01}}
    acting = actor.actor_of(again, head)
    np.testing.assert_array_equal(acting.rest_state().skin, head.skin.vertices)
    np.testing.assert_array_equal(acting.state(asked).skin, again.skin(asked))
    for damaged in (b"", data[:200], data[:-40]):
        with pytest.raises(InputError, match="prepare it again"):
            storage.from_bytes(damaged, head)


def test_one_side_is_learnt_from_the_other(reference, reference_model):
    """The right muscle was simulated at its end alone; how it gets there is seen in the mirror."""
    left, right = MUSCLE, MUSCLE[:-1] + "r"
    poses = [Pose({left: 1.0}), Pose({right: 1.0}), *(Pose({left: value}) for value in (0.2, 0.4, 0.7))]
    samples = finish(sampling.sampled(reference_model, poses))
    opposite = mirror.opposite_vertices(reference)
    asked = [control(reference_model, Pose({side: 0.4})) for side in (left, right)]
    images, alone = (finish(fit.fit_rig(reference_model, samples, 2, each)) for each in (opposite, None))
    known = images.skin(asked[0])
    off = [np.linalg.norm(rig.skin(asked[1]) - known[opposite] * (-1, 1, 1), axis=1).max() for rig in (images, alone)]
    assert off[0] < 0.15 < 0.5 < off[1], off


def test_images_count_for_as_much_as_both_sides_are_alike(reference, reference_model, flat_patch):
    names = reference_model.muscle_names
    count = len(input_names(names))
    rng = np.random.default_rng(2)
    inputs = rng.uniform(-1, 1, (5, count))
    inputs[1] = mirror.mirrored_inputs(names, inputs[:1])[0]
    np.testing.assert_array_equal(mirror.mirrored_inputs(names, inputs[1:2]), inputs[:1])
    opposite = mirror.opposite_vertices(reference)
    np.testing.assert_array_equal(opposite[opposite], np.arange(len(opposite)))
    own = rng.normal(size=(5, len(opposite), 3))
    own[1] = own[0, opposite] * (-1, 1, 1)
    for lopsided, alike in ((0.0, 1.0), (3.0, 2 / 11)):  # one and the same and noise of thrice its size
        own[1] += lopsided * rng.normal(size=own[1].shape)
        seen = mirror.seen_twice(names, inputs, own, opposite)
        assert seen.real.sum() == 5 and len(seen.own) == 5 + 3 and len(seen.both) == 2
        assert seen.alike(np.arange(len(opposite))) == pytest.approx(alike, abs=0.02)
    assert mirror.opposite_vertices(flat_patch(13, 60.0)) is None


def test_poses_drawn_stay_within_their_range_and_are_drawn_alike(reference_model):
    names = reference_model.muscle_names
    poses = sampling.drawn_poses(names, 40, np.random.default_rng(5))
    assert poses == sampling.drawn_poses(names, 40, np.random.default_rng(5))
    values = np.array([[pose.values().get(name, 0.0) for name in mixtures.channels(names)] for pose in poses])
    signed = np.isin(mixtures.channels(names), mixtures.SIGNED)
    assert values.max() == 1 and values[:, signed].min() == -1 and values[:, ~signed].min() == 0
    seen = values[len(sampling.single_poses(names)) :]
    assert (np.abs(seen).max(axis=1) > 0).all()
    # every channel that moves skin by itself was drawn
    still = [name for name, used in zip(mixtures.channels(names), np.abs(values).max(axis=0), strict=True) if not used]
    assert all(name.startswith(("masseter", "temporalis", "pterygoideus", "digastricus")) for name in still)
