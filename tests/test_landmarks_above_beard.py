# SPDX-License-Identifier: GPL-3.0-or-later
"""A beard, which a skin follows as if it were chin and jaw, does not lead the mouth astray."""

import numpy as np
import pytest

from headshop.sim.landmarks import above_beard
from headshop.sim.landmarks.above_beard import without_beards_lead
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import NoFaceError, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.progress import Progress, finish

HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
LIPS = ("ls", "sto", "li", "ch_l", "ch_r")


def _off(space, fit, truth):
    marks = space.landmarks(fit.points)
    return np.mean([np.linalg.norm(marks[name] - truth[name]) for name in LIPS])


@pytest.mark.parametrize("seed, deep, hanging", [(3, 12, 25), (5, 16, 30), (8, 16, 30)])
@pytest.mark.parametrize("in_a_furrow", [False, True])
def test_lips_are_found_in_a_beard(reference, bearded, monkeypatch, seed, deep, hanging, in_a_furrow):
    """Also where they lie so near in a furrow that the face is not doubted, if the chin is shaggy."""
    space = shape_space(reference)
    target, _, truth, fit = bearded(seed, deep, hanging)
    assert _off(space, fit, truth) > 7
    if in_a_furrow:
        monkeypatch.setattr(above_beard, "OFF", 99.0)
        monkeypatch.setattr(above_beard, "BAD", 99.0)
    again, beard = finish(without_beards_lead(reference, space, target, fit))
    assert _off(space, again, truth) < 4.5 and beard is not None


def test_where_a_beard_is_looked_for_on_rough_chins_only_others_take_no_time(reference, bearded, monkeypatch):
    space = shape_space(reference)
    target, _, _, fit = bearded(3, 0, 0)
    monkeypatch.setattr(above_beard, "OFF", 0.0)
    monkeypatch.setattr(above_beard, "fit_shape", lambda *_, **__: pytest.fail("it was laid again"))
    assert finish(without_beards_lead(reference, space, target, fit, rough=True)) == (fit, None)


def test_a_face_found_without_regard_to_a_beard_that_has_one_is_laid_beside_it(reference, bearded):
    space = shape_space(reference)
    target, _, truth, _ = bearded(3, 12, 25)
    above = finish(fit_shape(above_beard.above_beard(space), target, HERE))
    again, beard = finish(without_beards_lead(reference, space, target, above, above=True))
    assert beard is not None and again is not above and _off(space, again, truth) < 4.5


def test_a_face_found_without_regard_to_a_beard_that_has_none_is_laid_on_all(reference, bearded, monkeypatch):
    space = shape_space(reference)
    monkeypatch.setattr(above_beard, "BETTER", 0.0)  # whether that is better or not
    target, _, truth, _ = bearded(3, 0, 0)
    above = finish(fit_shape(above_beard.above_beard(space), target, HERE))
    again, beard = finish(without_beards_lead(reference, space, target, above, above=True))
    assert beard is None and again is not above and _off(space, again, truth) < 1.5
    names = ("pg", "gn", "go_l")
    assert np.mean([np.linalg.norm(space.landmarks(again.points)[n] - truth[n]) for n in names]) < 2.5


def test_a_face_without_a_beard_stays_as_it_is_and_takes_no_time(reference, bearded, monkeypatch):
    space = shape_space(reference)
    target, _, _, fit = bearded(3, 0, 0)
    monkeypatch.setattr(above_beard, "fit_shape", lambda *_, **__: pytest.fail("it was laid again"))
    assert finish(without_beards_lead(reference, space, target, fit)) == (fit, None)


def test_a_face_that_is_doubted_without_reason_stays_as_it_is(reference, bearded, monkeypatch):
    space = shape_space(reference)
    target, _, _, fit = bearded(3, 0, 0)
    monkeypatch.setattr(above_beard, "OFF", 0.0)
    assert finish(without_beards_lead(reference, space, target, fit)) == (fit, None)


def test_a_face_that_is_much_better_laid_from_above_is(reference, bearded, monkeypatch):
    """As under a cap, which drew the lower face up into the upper: no nearer above, but much better."""
    space = shape_space(reference)
    target, _, truth, fit = bearded(3, 0, 0)
    astray = fit.coefficients + 4 * space.parted
    points = space.shaped(astray)
    wrong = type(fit)(points, astray, HERE, fit.trust, fit.distance + 4.0, fit.spread)
    monkeypatch.setattr(above_beard, "NEARER", 0.0)
    again, _ = finish(without_beards_lead(reference, space, target, wrong))
    assert again is not wrong and _off(space, again, truth) < 1.5


def test_where_nothing_is_seen_above_the_face_stays_as_it_is(reference, bearded, monkeypatch):
    def none(*_, **__):
        raise NoFaceError
        yield

    space = shape_space(reference)
    target, _, _, fit = bearded(3, 12, 25)
    monkeypatch.setattr(above_beard, "fit_shape", none)
    assert finish(without_beards_lead(reference, space, target, fit)) == (fit, None)


def test_it_is_asked_of_grown_faces_whenever_landmarks_are_found(reference, seen_skin, monkeypatch):
    from headshop.sim.landmarks import find
    from headshop.sim.mesh import Mesh

    def stop(*_):
        yield Progress(0.0, "")
        raise LookupError

    target, _ = seen_skin()
    monkeypatch.setattr(find, "without_beards_lead", stop)
    with pytest.raises(LookupError):
        finish(find.find_landmarks(Mesh.from_triangles(target.vertices, target.triangles), reference))
