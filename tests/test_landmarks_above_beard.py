# SPDX-License-Identifier: GPL-3.0-or-later
"""A beard, which a skin follows as if it were chin and jaw, does not lead the mouth astray."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import above_beard
from headshop.sim.landmarks.above_beard import grows_beard, without_beards_lead
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import NoFaceError, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import vertex_normals
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.individual import draw_field

HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
LIPS = ("ls", "sto", "li", "ch_l", "ch_r")


@pytest.fixture(scope="module")
def somebody(reference):
    """``somebody(seed, deep, hanging)`` -> the scan of a person with a rough beard, ``deep`` mm, that hangs so many mm below
    the chin, the face laid on it, and the true landmarks."""
    space = shape_space(reference)

    def make(seed, deep, hanging):
        points = space.points + draw_field(reference.landmark_positions(), np.random.default_rng(seed))(space.points)
        truth, beard = space.landmarks(points), grows_beard(space)
        rough = deep * (1 + 0.35 * np.random.default_rng(1).standard_normal(len(points)))
        worn = points + (beard * rough)[:, None] * vertex_normals(points, space.triangles)
        worn[:, 2] -= hanging * beard * np.clip((truth["li"][2] - points[:, 2]) / 40, 0, 1)
        target = Surface(worn, space.triangles, smooth=2.0)
        return target, finish(fit_shape(space, target, HERE)), truth

    return make


def _off(space, fit, truth):
    marks = space.landmarks(fit.points)
    return np.mean([np.linalg.norm(marks[name] - truth[name]) for name in LIPS])


@pytest.mark.parametrize("seed, deep, hanging", [(3, 12, 25), (5, 16, 30), (8, 16, 30)])
def test_lips_are_found_in_a_beard(reference, somebody, seed, deep, hanging):
    space = shape_space(reference)
    target, fit, truth = somebody(seed, deep, hanging)
    assert _off(space, fit, truth) > 7
    again = finish(without_beards_lead(reference, space, target, fit))
    assert _off(space, again, truth) < 4.5


def test_a_face_without_a_beard_stays_as_it_is_and_takes_no_time(reference, somebody, monkeypatch):
    space = shape_space(reference)
    target, fit, _ = somebody(3, 0, 0)
    monkeypatch.setattr(above_beard, "fit_shape", lambda *_, **__: pytest.fail("it was laid again"))
    assert finish(without_beards_lead(reference, space, target, fit)) is fit


def test_a_face_that_is_doubted_without_reason_stays_as_it_is(reference, somebody, monkeypatch):
    space = shape_space(reference)
    target, fit, _ = somebody(3, 0, 0)
    monkeypatch.setattr(above_beard, "OFF", 0.0)
    assert finish(without_beards_lead(reference, space, target, fit)) is fit


def test_a_face_that_is_much_better_laid_from_above_is(reference, somebody, monkeypatch):
    """As under a cap, which drew the lower face up into the upper: no nearer above, but much better."""
    space = shape_space(reference)
    target, fit, truth = somebody(3, 0, 0)
    astray = fit.coefficients + 4 * space.parted
    points = space.shaped(astray)
    wrong = type(fit)(points, astray, HERE, fit.trust, fit.distance + 4.0, fit.spread)
    monkeypatch.setattr(above_beard, "NEARER", 0.0)
    again = finish(without_beards_lead(reference, space, target, wrong))
    assert again is not wrong and _off(space, again, truth) < 1.5


def test_where_nothing_is_seen_above_the_face_stays_as_it_is(reference, somebody, monkeypatch):
    def none(*_, **__):
        raise NoFaceError
        yield

    space = shape_space(reference)
    target, fit, _ = somebody(3, 12, 25)
    monkeypatch.setattr(above_beard, "fit_shape", none)
    assert finish(without_beards_lead(reference, space, target, fit)) is fit


def test_where_beards_grow(reference):
    space = shape_space(reference)
    beard, marks = grows_beard(space), space.landmarks(space.points)

    def there(place):
        return beard[np.linalg.norm(space.points - place, axis=1).argmin()]

    upper_lip = 0.5 * (marks["sn"] + marks["ls"])
    assert all(there(place) for place in (marks["pg"], marks["gn"], marks["go_l"], marks["go_r"], upper_lip))
    assert not any(there(marks[name]) for name in ("ls", "li", "ch_l", "sn", "prn", "zy_l", "t_r", "op", "g"))
    assert not beard[space.ear > 0.5].any()


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
