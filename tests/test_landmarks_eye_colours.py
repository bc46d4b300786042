# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether eyes are open is told by a scan's colours, and where nothing tells they are: lids are held open."""

import numpy as np
import pytest

from headshop.sim.adapt.build import build_head
from headshop.sim.landmarks import expression
from headshop.sim.landmarks.blank_eyes import best_outline
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.eye_colours import open_by_colours
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import Expression, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish

BOTH = ("l", "r")
HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
SKIN, WHITE, DARK = (0.75, 0.55, 0.45), (0.85, 0.85, 0.87), (0.12, 0.08, 0.06)


def _coloured(target, marks, eyes: bool, lashes=False):
    """The vertices of ``target`` with the colours of skin, and, if there are ``eyes``, of white with irises between lids."""
    colour = np.tile(np.float32(SKIN), (len(target.vertices), 1))
    for side in BOTH:
        middle = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2
        x, _, z = (target.vertices - middle).T
        if eyes:
            colour[(x / 14) ** 2 + ((z - 1) / 5.5) ** 2 < 1] = WHITE
            colour[x**2 + (z - 1) ** 2 < 5.5**2] = DARK
        if lashes:
            colour[(np.abs(x) < 14) & (np.abs(z + 2) < 0.6)] = DARK
    return Mesh.from_triangles(target.vertices, target.triangles, colour=colour)


def test_colours_tell_open_eyes_from_shut_ones(seen_skin):
    target, marks = seen_skin(BOTH)
    told = {eyes: open_by_colours(_coloured(target, marks, eyes), marks, np.eye(3)) for eyes in (False, True)}
    assert told == {False: False, True: True}
    assert open_by_colours(_coloured(target, marks, False, lashes=True), marks, np.eye(3)) is not True


def test_colours_that_are_no_skin_tell_nothing(seen_skin):
    target, marks = seen_skin(BOTH)
    scan = _coloured(target, marks, True)
    grey = Mesh(scan.vertices, scan.faces, colour=np.repeat(scan.colour.mean(axis=1, keepdims=True), 3, axis=1))
    bare = Mesh(scan.vertices, scan.faces)
    few = Mesh(scan.vertices[::200], scan.faces[:0], colour=scan.colour[::200])
    assert [open_by_colours(each, marks, np.eye(3)) for each in (grey, bare, few, None)] == [None] * 4


def test_an_eye_half_of_which_is_seen_as_one_tells_nothing(seen_skin):
    """As it is under strands of hair: every third point."""
    target, marks = seen_skin(BOTH)
    scan, skin = _coloured(target, marks, True), _coloured(target, marks, False)
    colour = np.where((np.arange(len(scan.colour)) % 3 == 0)[:, None], scan.colour, skin.colour)
    assert open_by_colours(Mesh(scan.vertices, scan.faces, colour=colour), marks, np.eye(3)) is None


@pytest.mark.parametrize("eyes", [True, False])
def test_lids_are_as_the_colours_have_them_where_the_surface_is_soft(reference, seen_skin, monkeypatch, eyes):
    target, marks = seen_skin(BOTH)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, HERE))
    monkeypatch.setattr(expression, "shut_by_sight", lambda *_: None)
    _, shown = finish(fit_expression(space, target, fit, _coloured(target, marks, eyes)))
    assert shown == (Expression(wide=True) if eyes else Expression(shut=BOTH))


def test_colours_count_for_more_than_a_crease_but_for_less_than_what_lies_between_lids(reference, seen_skin):
    space = shape_space(reference)
    shut, marks = seen_skin(BOTH)
    fit = finish(fit_shape(space, shut, HERE))
    assert finish(fit_expression(space, shut, fit))[1].shut == BOTH
    assert finish(fit_expression(space, shut, fit, _coloured(shut, marks, True)))[1].shut == ()
    opened, marks = seen_skin((), ("eye_l", "eye_r"))
    fit = finish(fit_shape(space, opened, HERE))
    assert finish(fit_expression(space, opened, fit, _coloured(opened, marks, False)))[1].lids


def test_where_nothing_tells_lids_are_held_open(reference, seen_skin, monkeypatch):
    """Soft scans of open eyes were taken for shut ones, because those fitted a little better, or were left half shut."""
    target, _ = seen_skin(BOTH)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, HERE))
    monkeypatch.setattr(expression, "shut_by_sight", lambda *_: None)
    laid, shown = finish(fit_expression(space, target, fit))
    assert shown == Expression(wide=True)
    marks, rest = space.landmarks(laid.points), space.landmarks(space.points)
    for side in BOTH:
        opening, usual = (np.linalg.norm(m[f"ps_{side}"] - m[f"pi_{side}"]) for m in (marks, rest))
        assert 0.75 * usual < opening < 1.25 * usual


def test_lids_that_are_seen_to_be_open_are_as_the_scan_has_them_and_others_held(reference, seen_skin, monkeypatch):
    """Where nothing shows lids, a fit may have them too far open as well as half shut."""
    target, _ = seen_skin(BOTH)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, HERE))
    monkeypatch.setattr(expression, "shut_share", lambda *_: {"l": -0.3, "r": -0.2})
    shown = {}
    for sight in (False, None):
        monkeypatch.setattr(expression, "shut_by_sight", lambda *_, sight=sight: sight)
        shown[sight] = finish(fit_expression(space, target, fit))[1]
    assert shown == {False: Expression(), None: Expression(wide=True)}


@pytest.fixture
def asked(monkeypatch):
    """The scans of which lips and lids were asked; the work ends there, with a LookupError."""
    from headshop.sim.landmarks import find, laid_head

    scans = []

    def stop(space, target, fit, scan):
        scans.append(scan)
        raise LookupError
        yield

    monkeypatch.setattr(find, "fit_expression", stop)
    monkeypatch.setattr(laid_head, "fit_expression", stop)
    return scans


def test_a_build_looks_at_the_colours_too(reference, seen_skin, asked):
    target, marks = seen_skin(BOTH)
    scan = _coloured(target, marks, True)
    with pytest.raises(LookupError):
        finish(build_head(reference, scan, marks))
    assert asked == [scan]


def test_landmarks_are_found_with_the_colours_where_the_face_is(reference, seen_skin, asked):
    """Whatever the scan's unit: the colours are looked at in mm, as all else is."""
    target, marks = seen_skin(BOTH)
    scan = _coloured(target, marks, True)
    with pytest.raises(LookupError):
        finish(find_landmarks(scan.moved(scan.vertices / 1000), reference, (1000.0,)))
    np.testing.assert_allclose(asked[0].vertices, scan.vertices, atol=1e-9)
    assert asked[0].colour is scan.colour


def test_no_lower_lid_is_outlined_above_the_corners():
    """The fold of an upper lid, which steps back and forward as well, passed for a blank eye 14 mm too high."""
    y, x = np.mgrid[20:-20.5:-0.5, -28:28.5:0.5]

    def band(height, bow, half=14.0):
        curve = height + bow * np.clip(1 - (x / half) ** 2, 0, 1)
        return np.exp(-(((y - curve) / 1.2) ** 2)) * (np.abs(x) < half)

    fold = band(5.0, 8.0) - band(5.0, 1.5)  # steps back, and forward again, over the eye
    eye = 0.8 * (band(0.0, 6.0) - band(0.0, -4.0))
    outline = best_outline(np.clip(fold + eye, -1, 1), 14.0)
    assert outline[5] <= 0 and abs(outline[4] - 6) < 1.5 and abs(outline[5] + 4) < 1.5
