# SPDX-License-Identifier: GPL-3.0-or-later
"""Infants' faces: their measurements, and how they are found where a grown one is no likely shape of them."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks import find, infant, laid_head, looking, placed_face
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.infant import infant_points, infant_space, with_mouth_in_place
from headshop.sim.landmarks.lip_line import lip_height, lip_line
from headshop.sim.landmarks.looks import LOOKS, PARTS
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.verdict import ODD, Verdict, judged
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.individual import draw_field

FORWARD = np.array([0.0, -1.0, 0.0])
UPSIDE_DOWN = np.diag([-1.0, 1.0, -1.0])  # turned about the axis out of the face


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def infants(reference, space):
    return infant_space(reference, space)


def _last(work):
    """What a generator returns."""
    try:
        while True:
            next(work)
    except StopIteration as end:
        return end.value


def _laid(space, target, turn, nose):
    """A fit of ``space`` begun with that turn, its nose at a place."""
    shift = nose - space.size * turn @ space.landmarks(space.points)["prn"]
    return _last(fit_shape(space, target, Pose(space.size, turn, shift, 0.0)))


def test_an_infant_has_its_share_of_a_grown_ones_measurements(reference):
    """Those that are plain distances in one direction, read from the table; the size is the mean of all shares."""
    grown = reference.landmark_positions()
    moved = infant_points(reference, np.array(list(grown.values())))
    size = infant_space(reference, shape_space(reference)).size
    child = dict(zip(grown, size * moved, strict=True))
    with open(infant.TABLE, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    shares = [float(row["of_adult"]) for row in rows]
    assert min(shares) < size < max(shares)
    plain = [r for r in rows if r["axis"] in "xyz" and r["at"] in grown and r["from"] in grown]
    assert len(plain) > 15
    for row in plain:
        axis = "xyz".index(row["axis"])
        of = (child[row["at"]] - child[row["from"]])[axis] / (grown[row["at"]] - grown[row["from"]])[axis]
        assert of == pytest.approx(float(row["of_adult"]), abs=0.015), row["measurement"]
    for row in (row for row in rows if row["axis"] == "along"):  # whichever way they lie on either
        ends = row["at"].replace("*", "l"), row["from"].replace("*", "l")
        of, whole = (np.linalg.norm(head[ends[0]] - head[ends[1]]) for head in (child, grown))
        assert of / whole == pytest.approx(float(row["of_adult"]), abs=0.006), row["measurement"]


def test_lips_are_found_farther_off_than_a_fit_that_knows_them_lies(reference):
    skin = reference.skin
    target = Surface(drawn(skin.faces, skin.vertices), skin.triangles)
    marks = reference.landmark_positions()
    above = {name: place + [0.0, 0.0, 12.0] for name, place in marks.items()}
    line = lip_line(target, above, FORWARD)
    assert line is None or abs(line.middle - marks["sto"])[2] > 2.0
    assert abs(lip_height(target, above, FORWARD) - marks["sto"])[2] < 1.5
    assert lip_height(target, {name: place + [0.0, 0.0, 60.0] for name, place in marks.items()}, FORWARD) is None


def test_a_mouth_lower_than_infants_have_it_is_met(infants):
    """A fit that has the lips where the likeliest infant has them finds those that lie 12 mm (of a grown head) lower."""
    points = infants.size * infants.points
    marks = infants.landmarks(points)
    fit = _laid(infants, Surface(points, infants.triangles), np.eye(3), marks["prn"])
    lower = np.exp(
        -(((infants.points - infants.landmarks(infants.points)["sto"]) / [30.0, 30.0, 16.0]) ** 2).sum(axis=1) / 2
    )
    points = points - 12.0 * infants.size * lower[:, None] * [0.0, 0.0, 1.0]
    target, mouth = Surface(points, infants.triangles), infants.landmarks(points)["sto"]
    before = infants.landmarks(fit.points)["sto"]
    after = infants.landmarks(_last(with_mouth_in_place(infants, target, fit)).points)["sto"]
    assert abs(before - mouth)[2] > 6.0
    assert abs(after - mouth)[2] < 1.0


def test_an_infants_face_upside_down_is_turned_over(reference, infants):
    """A round face lies on an infant's upside down as well; only ears and relief tell. It is begun again the other way up."""
    points = infants.size * infants.points
    target = Surface(points, infants.triangles)
    nose = infants.landmarks(points)["prn"]
    for wrong in (nose, nose + [0.0, 0.0, 35.0]):  # nose on the nose, or on the brow
        fit = _laid(infants, target, UPSIDE_DOWN, wrong)
        assert fit.pose.turn[2, 2] < -0.8
        verdict = judged(reference, infants, fit, 0.7)._replace(doubtful=False, bad=0.1)  # as if it fitted well
        result = (verdict, 1.0, fit, target, infants)
        best = finish(placed_face._or_turned_over(reference, result))
        assert best[2].pose.turn[2, 2] > 0.95
        assert np.linalg.norm(infants.landmarks(best[2].points)["prn"] - nose) < 1.5


def test_size_counts_from_that_of_an_infant(reference, space, infants):
    """An infant of its size is as little bad as a grown face of a grown one's; the same face grown is worse; and a fit that
    knows about how large heads are comes back to its size."""
    points = infants.size * infants.points
    target, nose = Surface(points, infants.triangles), infants.landmarks(points)["prn"]
    fit = _laid(infants, target, np.eye(3), nose)
    bad = judged(reference, infants, fit, 0.7).bad
    assert bad < 0.7 * judged(reference, replace(infants, size=1.2), fit, 0.7).bad
    assert bad == pytest.approx(judged(reference, replace(infants, size=fit.pose.scale), fit, 0.7).bad, rel=0.01)
    near = infants.size * infants.points[:, [2]] > nose[2]  # with little of the face, size is what it is said to be
    few = Surface(points, infants.triangles[near[infants.triangles, 0].all(axis=1)])
    start = Pose(
        0.85 * infants.size, np.eye(3), nose - 0.85 * infants.size * infants.landmarks(infants.points)["prn"], 0.0
    )
    assert _last(fit_shape(infants, few, start, size=0.01)).pose.scale == pytest.approx(infants.size, rel=0.03)


@pytest.mark.parametrize(
    "bad, doubtful, taken", [(8.0, False, True), (8.9, False, False), (12.0, False, False), (8.0, True, False)]
)
def test_a_face_is_laid_anew_as_an_infants_only_where_that_is_plainly_less_bad(
    reference, space, infants, monkeypatch, bad, doubtful, taken
):
    """Of a head cut off above the brows a child's face is, in some turns, a little less bad than its own."""
    points = infants.size * infants.points
    target = Surface(points, infants.triangles)
    fit = _laid(space, target, np.eye(3), infants.landmarks(points)["prn"])
    monkeypatch.setattr(placed_face, "judged", lambda *args: Verdict(doubtful or args[-1] is not target, bad, 0.8))
    best = finish(placed_face._or_infant(reference, (Verdict(False, 10.0, 0.7), 1.0, fit, target, space), 0.85))
    assert best[4].of_infants == taken


def test_ears_tell_which_way_up_an_infants_face_is(monkeypatch):
    ears = {"right": {"l": 0.9, "r": 0.9}, "wrong": {"l": 0.5, "r": 0.4}, "none": {"l": 0.0, "r": 0.0}}
    monkeypatch.setattr(placed_face, "like_ears", lambda space, fit, target: ears[fit])

    def best(*results):
        return min(((v, 1.0, fit, None, None) for v, fit in results), key=placed_face._by_likeness)[2]

    assert best((Verdict(False, 6.0, 0.78), "wrong"), (Verdict(False, 8.0, 0.76), "right")) == "right"
    assert best((Verdict(False, 6.0, 0.78), "wrong"), (Verdict(True, 8.0, 0.9), "right")) == "wrong"
    assert best((Verdict(False, 6.0, 0.9), "wrong"), (Verdict(False, 5.0, 0.72), "none")) == "wrong"


@pytest.mark.parametrize(("bad", "asked"), [(ODD - 0.1, False), (ODD + 0.1, True)])
def test_an_odd_face_may_be_an_infants(reference, space, monkeypatch, bad, asked):
    """The face found is laid anew as an infant's if it is odd as a grown one, and only then."""

    def work(value):
        yield Progress(0.5, "")
        return value

    def other(reference, result, less):
        return work((*result[:2], "infant", None, infant_space(reference, result[4])))

    found = [(Verdict(False, bad, 0.8), 1.0, "grown", None)]
    monkeypatch.setattr(looking, "_trials", lambda *rest: work([(1.0, 1.0, None, None)]))
    monkeypatch.setattr(looking, "_fits", lambda *rest: work(found))
    monkeypatch.setattr(placed_face, "_or_infant", other)
    monkeypatch.setattr(placed_face, "share_of", lambda *_: 1.0)
    _, fit, _, of = finish(placed_face.place_face(reference.skin, reference, space, (1.0,)))
    assert (fit, of.of_infants) == (("infant", True) if asked else ("grown", False))
    monkeypatch.setattr(placed_face, "LOOKS", LOOKS[-1:])  # above a beard, which no infant has
    monkeypatch.setattr(placed_face, "PARTS", PARTS[-1:])
    _, fit, _, of = finish(placed_face.place_face(reference.skin, reference, space, (1.0,)))
    assert (fit, of.of_infants) == ("grown", False) and not of.area.all()


def _child(reference, seed, size, low):
    """A map of points of the reference to those of a child that is not the likeliest: ``size`` times as large as that, its
    mouth ``low`` mm (of a grown head) lower."""
    marks = reference.landmark_positions()
    field = draw_field(marks, np.random.default_rng(seed), 0.6)
    size = size * infant_space(reference, shape_space(reference)).size

    def child(points):
        near = np.exp(-(((points - marks["sto"]) / [30.0, 40.0, 14.0]) ** 2).sum(axis=1) / 2)
        return size * (infant_points(reference, points) + field(points) - low * near[:, None] * [0.0, 0.0, 1.0])

    return child


def _scanned(reference, child):
    """What `_child` makes of the reference: the scan, and all landmarks."""
    skin, marks = reference.skin, reference.landmark_positions()
    scan = Surface(child(drawn(skin.faces, skin.vertices)), skin.triangles, smooth=2.0)
    return scan, dict(zip(SKIN, child(np.array([marks[n] for n in SKIN])), strict=True))


@pytest.mark.parametrize(("low", "nearer"), [(12.0, 2.5), (20.0, 3.0)])
def test_landmarks_given_on_an_infant_tell_the_others(reference, low, nearer):
    """Ten of them, none of the mouth, of a child whose mouth is lower than infants' usually are."""
    scan, truth = _scanned(reference, _child(reference, 9, 0.8, low))
    ten = [*(f"{mark}_{side}" for mark in ("en", "ex", "al", "t") for side in "lr"), "prn", "gn"]
    guessed = finish(first_look(reference, scan, {n: truth[n] for n in ten})).guessed
    for name in ("li", "ch_l", "ch_r"):
        assert np.linalg.norm(guessed[name] - truth[name]) < nearer, name


@pytest.mark.parametrize("of", ["a child", "a large child", "a small cast of a grown head"])
def test_what_somebody_picked_on_an_infant_is_told(reference, monkeypatch, of):
    """And nothing that was found, nothing of hair and skull, and nothing of a head with a grown one's size or face."""
    cast = draw_field(reference.landmark_positions(), np.random.default_rng(9), 0.6)
    maps = {
        "a child": _child(reference, 9, 0.8, 0.0),
        "a large child": _child(reference, 9, 1.35, 0.0),
        "a small cast of a grown head": lambda points: 0.65 * (points + cast(points)),
    }
    scan, truth = _scanned(reference, maps[of])
    asked = []

    def spy(space, target, pose, told=None):
        asked.append((space, pose, told))
        return fit_shape(space, target, pose, told=told)

    def beardless(reference, space, target, fit, **_):
        beards.append(space.of_infants)
        yield Progress(0.5, "")
        return fit, None

    beards = []
    monkeypatch.setattr(laid_head, "fit_shape", spy)
    monkeypatch.setattr(laid_head, "without_beards_lead", beardless)
    finish(first_look(reference, scan, truth, found=("ch_l", "g", "t_r")))
    ((space, pose, told),) = asked
    assert beards == ([] if of == "a child" else [False])
    assert space.of_infants == (of == "a child")
    if of != "a child":
        assert told is None
        return
    names = [n for n in truth if n not in ("ch_l", "g", "t_r") and n.partition("_")[0] not in ("v", "op", "eu", "tr")]
    assert len(told.places) == len(names)
    own = dict(zip(map(tuple, told.corners), told.places, strict=True))
    for name in ("prn", "ch_r", "sa_l"):
        place = own[tuple(space.corners[space.names.index(name)])]
        picked = pose.scale * pose.turn @ moved(name)
        assert np.linalg.norm(place + picked - truth[name]) < 1e-9


def test_an_infant_is_found_in_any_turn_by_the_look_for_one(reference, monkeypatch):
    """By that look alone: a child that is not the likeliest, small for its year, its mouth low, turned at random."""
    skin, marks = reference.skin, reference.landmark_positions()
    turn = np.linalg.qr(np.random.default_rng(7).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    upright = _child(reference, 7, 0.8, 12.0)

    def child(points):
        return upright(points) @ turn.T

    def mouth(space, target, fit):
        asked.append(space.of_infants)
        return with_mouth_in_place(space, target, fit)

    asked = []
    monkeypatch.setattr(placed_face, "LOOKS", LOOKS[3:])
    monkeypatch.setattr(placed_face, "PARTS", PARTS[3:])
    monkeypatch.setattr(find, "with_mouth_in_place", mouth)
    found = finish(find.find_landmarks(skin.moved(child(skin.vertices)), reference))
    truth = child(np.array([marks[n] for n in SKIN]))
    off = np.linalg.norm(np.array([found.positions[n] for n in SKIN]) - truth, axis=1)
    assert asked == [True]
    assert off.mean() < 2.5
