# SPDX-License-Identifier: GPL-3.0-or-later
"""Blank eyes of mannequins and statues are seen by the outline of their lids, and shut eyes are not taken for them."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.landmarks import blank_eyes as module
from headshop.sim.landmarks.blank_eyes import X, Y, best_outline, blank_eyes, counted, height_of, is_blank, slope
from headshop.sim.landmarks.expression import fit_expression, shut_share
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply

BOTH = ("l", "r")
HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
CORNERS, MARGINS = ("ex_l", "ex_r"), ("ps_l", "pi_l", "ps_r", "pi_r")


@pytest.fixture(scope="module")
def blank(seen_skin):
    """The reference's skin as a surface whose open eyes are filled with plates a little behind the lids, and its landmarks."""
    target, marks = seen_skin()
    edges = np.sort(target.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    rim = target.vertices[np.unique(edges[count == 1])]
    for side in BOTH:
        middle = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2
        loop = rim[np.linalg.norm(rim - middle, axis=1) < 25]
        centre = loop.mean(axis=0)
        loop = loop[np.argsort(np.arctan2(*(loop - centre)[:, [2, 0]].T))]
        target = target.beside(*plate(loop))
    return target, marks


def plate(loop, behind: float = 1.0, rings: int = 6):
    """Vertices and triangles of a plate within a ``loop`` (k, 3), ``behind`` it but for its edge."""
    centre, k = loop.mean(axis=0) + [0, behind, 0], len(loop)
    shares = np.linspace(1, 0, rings, endpoint=False)
    back = np.where(shares < 1, behind, 0.0)[:, None] * [0, 1, 0]
    flat = loop.mean(axis=0) + shares[:, None, None] * (loop - loop.mean(axis=0)) + back[:, None]
    vertices = np.concatenate([flat.reshape(-1, 3), centre[None]])
    a, ring = np.arange(k), np.arange(rings - 1)[:, None] * k
    b = (a + 1) % k
    sides = [np.stack([ring + p, ring + q, ring + r], axis=-1) for p, q, r in ((a, b, k + b), (a, k + b, k + a))]
    last = (rings - 1) * k
    fan = np.stack([last + a, last + b, np.full(k, rings * k)], axis=-1)
    return vertices, np.concatenate([part.reshape(-1, 3) for part in (*sides, fan)])


def test_the_outline_of_blank_eyes_is_that_of_their_lids(blank):
    target, marks = blank
    seen = blank_eyes(marks, np.eye(3), target)
    assert set(seen) == {*CORNERS, *MARGINS}
    for name, place in seen.items():
        assert abs(place - marks[name] - moved(name))[2] < 1.5, name
    assert min((seen[f"ps_{side}"] - seen[f"pi_{side}"])[2] for side in BOTH) > 6.0


def test_it_is_found_where_eyes_are_looked_for_too_low(blank):
    target, marks = blank
    low = {name: place - [0, 0, 4.0] for name, place in marks.items()}
    seen, true = blank_eyes(low, np.eye(3), target), blank_eyes(marks, np.eye(3), target)
    for name in (*CORNERS, *MARGINS):
        assert abs(seen[name] - true[name])[2] < 1.0, name


def test_a_turned_head_of_another_size_has_the_same(blank):
    target, marks = blank
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= 1.3 * np.sign(np.linalg.det(turn))
    there = {name: turn @ place for name, place in marks.items()}
    seen = blank_eyes(there, turn, Surface(target.vertices @ turn.T, target.triangles))
    true = blank_eyes(marks, np.eye(3), target)
    assert set(seen) == {*CORNERS, *MARGINS}
    for name, place in seen.items():
        assert np.linalg.norm(place / 1.3 - turn @ true[name] / 1.3) < 0.5, name


def test_shut_eyes_are_not_blank(seen_skin):
    target, marks = seen_skin(BOTH)
    assert blank_eyes(marks, np.eye(3), target) == {}


def test_neither_is_one_alone(blank, seen_skin):
    """What is the margins of lids on one side only is none."""
    (target, marks), (shut, _) = blank, seen_skin(BOTH)
    left = target.without(target.vertices[target.triangles][:, :, 0].min(axis=1) < 0)
    right = shut.without(shut.vertices[shut.triangles][:, :, 0].max(axis=1) > 0)
    mixed = left.beside(right.vertices, right.triangles)
    assert blank_eyes(marks, np.eye(3), mixed) == {}
    assert set(blank_eyes(marks, np.eye(3), mixed, "l")) == {"ex_l", "ps_l", "pi_l"}
    assert blank_eyes(marks, np.eye(3), right, "l") == {}  # of which nothing is seen


def almond(upper, lower):
    """Depth (r, c) mm of an eye between corners 14 mm to either side that steps back by ``upper`` under the upper lid, and
    comes forward by ``lower`` at the lower one; and where that eye is."""
    x, y = np.meshgrid(X, Y)
    bow = 1 - (x / 14) ** 2
    under, below = (y < 7 * bow) & (bow > 0), (y < -4 * bow) & (bow > 0)
    return upper * under - lower * below, under & ~below


def test_an_outline_is_that_of_both_steps():
    image = slope(almond(0.6, 0.6)[0])
    outline = best_outline(counted(image), 14.0)
    assert is_blank(image, outline)
    assert height_of(outline, "ps", 0.0) == pytest.approx(7.0, abs=1.0)
    assert height_of(outline, "pi", 0.0) == pytest.approx(-4.0, abs=1.0)
    assert abs(height_of(outline, "en", -12.0)) < 2.0


def test_two_steps_back_are_a_fold_and_lids_that_meet():
    image = slope(almond(0.6, -0.6)[0])
    assert not is_blank(image, best_outline(counted(image), 14.0))


def test_what_is_as_rough_inside_is_no_eyeball():
    depth, inside = almond(0.6, 0.6)
    outline = np.array([-14.0, 0.0, 14.0, 0.0, 7.0, -4.0])
    assert is_blank(slope(depth), outline)
    assert not is_blank(slope(depth + 0.6 * inside * np.sin(Y * np.pi / 2)[:, None]), outline)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_has_no_outline(seed):
    image = slope(0.3 * gaussian_filter(np.random.default_rng(seed).standard_normal((len(Y), len(X))), 1.5))
    assert not is_blank(image, best_outline(counted(image), 14.0))


def test_lids_laid_low_over_a_blank_eye_go_to_its_outline(reference, blank):
    """The skin takes such an eyeball for lid: with lids that hang to begin with they stay there, if nothing tells."""
    target, marks = blank
    space = shape_space(reference)
    hang = sum(0.5 * way for way in space.shut.values())
    fit = finish(fit_shape(space, target, HERE, ((0.5, 3.0, 2.0, 0.5),), hang))
    after, shown = finish(fit_expression(space, target, fit))
    assert set(shown.lids) == {*CORNERS, *MARGINS} and not shown.shut
    laid = space.landmarks(after.points)
    assert max(abs(laid[f"ps_{side}"] - marks[f"ps_{side}"])[2] for side in BOTH) < 2.0
    assert max(shut_share(space, after).values()) < 0.15


def test_of_half_a_face_the_eye_that_is_seen_tells(reference, blank):
    target, _ = blank
    half = target.without(target.vertices[target.triangles][:, :, 0].max(axis=1) > 6.0)
    _, shown = finish(
        fit_expression(shape_space(reference), half, finish(fit_shape(shape_space(reference), half, HERE)))
    )
    assert set(shown.lids) == {"ex_r", "ps_r", "pi_r"}


def test_eyes_known_to_be_open_are_not_looked_at_again(reference, seen_skin, monkeypatch):
    monkeypatch.setattr(module, "best_outline", lambda *_: pytest.fail("looked for"))
    target, _ = seen_skin()
    space = shape_space(reference)
    _, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    assert set(MARGINS) <= set(shown.lids)


def test_the_eyes_of_a_mannequin(shared, reference):
    """Its flat eyeballs were taken for lids half shut: margins of upper lids 6 mm too low."""
    path = shared / "scans" / "rvcg_dummyhead.ply"
    found = finish(find_landmarks(clean_scan(read_ply(path))[0], reference)).positions
    true = read_landmarks(path.with_suffix(".landmarks.json"))
    off = {name: np.linalg.norm(found[name] - true[name]) for name in (*CORNERS, *MARGINS, "en_l", "en_r")}
    assert max(off.values()) < 3.5 and np.mean(list(off.values())) < 2.0, off
