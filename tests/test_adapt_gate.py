# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate on people: no landmarks of their own are refused, every kind of mistake is, in its own words."""

import numpy as np
import pytest

from headshop.sim.adapt.arrangement import Faces
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.fit_sentence import doubts
from headshop.sim.adapt.gate import (
    check_against_scan,
    check_arrangement,
    check_likeness,
    check_on_face,
    check_on_surface,
    doubted,
)
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.relief import face_likeness
from headshop.sim.anatomy.landmark_names import SKIN, mirrored
from headshop.sim.errors import InputError
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply

TWELVE = "ex_l ex_r en_l en_r prn sn ch_l ch_r gn n t_l t_r".split()
SCANS = ("lps_infinite", "menpo_james", "fran_cyberware", "rvcg_dummyhead")


@pytest.fixture(scope="module")
def people(shared):
    """Name -> (surface of the scan, its landmarks)."""
    out = {}
    for name in SCANS:
        scan, _ = clean_scan(read_ply(shared / "scans" / f"{name}.ply"))
        marks = read_landmarks(shared / "scans" / f"{name}.landmarks.json")
        out[name] = Surface(scan.vertices, scan.triangles), marks
    return out


def _check(reference, surface, marks):
    check_against_scan(marks, surface)
    check_arrangement(reference.landmark_positions(), marks)
    check_on_surface(marks, surface)


def _refusal(act, *arguments) -> str:
    with pytest.raises(InputError) as refusal:
        act(*arguments)
    sentence = str(refusal.value)
    assert "\n" not in sentence and sentence.endswith(".") and sentence.count(". ") == 0
    return sentence


@pytest.mark.parametrize("few", [SKIN, TWELVE, ("ex_l", "ex_r", "prn", "gn")])
def test_their_own_landmarks_pass(people, reference, few):
    for surface, marks in people.values():
        _check(reference, surface, {n: p for n, p in marks.items() if n in few})


@pytest.mark.parametrize("few", [SKIN, TWELVE])
def test_those_of_another_head_do_not(people, reference, few):
    caught = {}
    for mine, (surface, _) in people.items():
        for whose, (_, marks) in people.items():
            if mine != whose:
                try:
                    _check(reference, surface, {n: p for n, p in marks.items() if n in few})
                except InputError as error:
                    caught[mine, whose] = str(error)
    assert len(caught) >= (10 if few is SKIN else 8), "of twelve: all four lie in one place, and some are alike"
    assert sum("another head" in sentence for sentence in caught.values()) > 6


def test_beside_the_surface_and_off_the_face_at_once_is_anothers(reference):
    """Either alone may be an error of picking, or an unusual face."""
    surface = Surface(reference.skin.vertices, reference.skin.triangles)
    laid = reference.landmark_positions()
    beside = {n: p + [0.0, -4.0, 0.0] for n, p in laid.items()}
    check_on_face(beside, laid, surface)
    check_on_face(laid, {n: p + 9.0 for n, p in laid.items()}, surface)
    off = {n: p + 9.0 for n, p in laid.items()}
    assert "another head's" in _refusal(check_on_face, beside, off, surface)
    check_on_face({n: beside[n] for n in ("ex_l", "ex_r", "prn", "gn")}, off, surface)


@pytest.mark.parametrize(("mine", "whose"), [("menpo_james", "fran_cyberware"), ("fran_cyberware", "menpo_james")])
def test_those_of_somebody_else_in_the_same_place_do_not(people, reference, mine, whose):
    """They come so near that the surface alone does not tell."""
    surface = people[mine][0]
    for name in (mine, whose):
        marks = people[name][1]
        laid = finish(first_look(reference, surface, marks)).laid
        if name == mine:
            check_on_face(marks, laid, surface)
        else:
            assert "another head's" in _refusal(check_on_face, marks, laid, surface)


@pytest.mark.parametrize("name", SCANS)
def test_exchanged_sides_and_pairs_are_named(people, reference, name):
    """All sides, and every single pair."""
    rest, marks = reference.landmark_positions(), people[name][1]
    swapped = {mirrored(n) if mirrored(n) in marks else n: p for n, p in marks.items()}
    assert "left and right are exchanged" in _refusal(check_arrangement, rest, swapped)
    pairs = [(n, mirrored(n)) for n in marks if n.endswith("_l") and mirrored(n) in marks]
    for left, right in pairs[:: max(len(pairs) // 6, 1)]:
        said = _refusal(check_arrangement, rest, marks | {left: marks[right], right: marks[left]})
        assert f'"{left}" and "{right}" are exchanged' in said


def test_several_exchanges_are_all_named(people, reference):
    marks = people["lps_infinite"][1]
    wrong = marks | {"ex_l": marks["ex_r"], "ex_r": marks["ex_l"], "ls": marks["gn"], "gn": marks["ls"]}
    said = _refusal(check_arrangement, reference.landmark_positions(), wrong)
    assert '"ex_l" and "ex_r"' in said and ('"ls" and "gn"' in said or '"gn" and "ls"' in said)


def test_a_landmark_far_off_is_named(people, reference):
    rest = reference.landmark_positions()
    rng = np.random.default_rng(5)
    for few in (SKIN, TWELVE):
        for _, marks in people.values():
            given = {n: p for n, p in marks.items() if n in few}
            for name in [n for n in ("ex_l", "prn", "ch_r", "sn", "n") if n in given]:
                off = rng.normal(size=3)
                wrong = given | {name: given[name] + 55 * off / np.linalg.norm(off)}
                assert f'"{name}"' in _refusal(check_arrangement, rest, wrong)


def test_of_landmarks_that_nobody_picked_none_is_to_be_placed_again(reference):
    rest = reference.landmark_positions()
    wrong = rest | {"prn": rest["prn"] + 40.0}
    said = _refusal(check_arrangement, rest, wrong, set(rest))
    assert "What was found" in said and '"prn"' in said and "--landmarks" in said and "again" not in said
    for found in ((), set(rest) - {"n"}):
        assert '"prn"' in (said := _refusal(check_arrangement, rest, wrong, found)) and "place it again" in said
    few = {n: rest[n] for n in ("ex_l", "ex_r", "ch_l", "ch_r")} | {"prn": rest["prn"] + [0.0, -90.0, 90.0]}
    assert "What was found" in (said := _refusal(check_arrangement, rest, few, set(few))) and "names" not in said
    assert "The landmarks do not form a face" in _refusal(check_arrangement, rest, few)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "metres"), (10.0, "centimetres"), (25.4, "inches")])
def test_wrong_units_are_named(people, reference, factor, unit):
    surface, marks = people["lps_infinite"]
    said = _refusal(check_against_scan, {n: p / factor for n, p in marks.items()}, surface)
    assert f"landmarks were in {unit}" in said and f"{factor:g}" in said and "--units" in said
    small = Surface(surface.vertices / factor, surface.triangles)
    said = _refusal(check_against_scan, marks, small)
    assert f"scan were in {unit}" in said


def test_upside_down_is_refused(people, reference):
    """The landmarks of a scan that was turned afterwards."""
    turn = np.diag([-1.0, 1.0, -1.0])
    for surface, marks in people.values():
        centre = surface.vertices.mean(axis=0)
        turned = {n: turn @ (p - centre) + centre for n, p in marks.items()}
        _refusal(_check, reference, surface, turned)


def test_mid_air_is_legal(people, reference):
    """Landmarks over holes: everything around four of them is cut away."""
    surface, marks = people["lps_infinite"]
    gone = np.zeros(len(surface.vertices), dtype=bool)
    for name in ("ch_l", "zy_l", "al_l", "gn"):
        gone |= np.linalg.norm(surface.vertices - marks[name], axis=1) < 18
    holed = Surface(surface.vertices, surface.triangles[~gone[surface.triangles].any(axis=1)])
    _check(reference, holed, marks)


def test_stretched_faces_pass_in_any_pose_and_size(reference):
    """Broader, longer, flatter faces, each landmark moved by the millimetres by which they are picked."""
    rest = reference.landmark_positions()
    faces = Faces(rest, list(rest))
    for seed in range(6):
        rng = np.random.default_rng(seed)
        places = np.array(list(rest.values())) * rng.uniform(0.9, 1.1, 3) * rng.uniform(0.85, 1.15)
        places += rng.normal(0, 1.5, places.shape)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        moved = places @ turn.T + rng.normal(0, 300, 3)
        check_arrangement(rest, dict(zip(rest, moved, strict=True)))
        here, there = faces.likeness(places), faces.likeness(moved)
        np.testing.assert_allclose(there.strange, here.strange, rtol=1e-3, atol=1e-3)


def test_leaving_one_out_is_what_the_others_predict(reference):
    """The closed form against the same field without that landmark."""
    rest = reference.landmark_positions()
    rng = np.random.default_rng(3)
    given = {n: p + rng.normal(0, 3, 3) for n, p in rest.items() if n in TWELVE}
    places = np.array(list(given.values()))
    whole = Faces(rest, list(given)).likeness(places)
    lifted = places.copy()
    lifted[3] += [40.0, 0.0, 0.0]
    moved = Faces(rest, list(given)).likeness(lifted)
    # The others say the same whatever the one does, apart from the pose about which all is taken as linear.
    np.testing.assert_allclose(np.linalg.norm(moved.off[3] - whole.off[3]), 40, atol=4)


def test_a_ball_is_no_face(reference):
    skin = reference.skin
    fitted = np.ones(len(skin.vertices))
    assert face_likeness(reference, skin.vertices, fitted) > 0.999
    bent = skin.vertices * [1.1, 0.95, 1.05] + 2 * np.sin(skin.vertices[:, [1, 2, 0]] / 30)
    check_likeness(reference, drawn(skin.faces, bent), fitted)
    ball = 95 * skin.vertices / np.linalg.norm(skin.vertices, axis=1, keepdims=True)
    assert "no face" in _refusal(check_likeness, reference, ball, fitted)
    assert np.isnan(face_likeness(reference, ball, np.zeros(len(fitted))))


@pytest.mark.parametrize("name", ["lps_infinite", "menpo_james"])
def test_a_landmark_elsewhere_on_the_face_is_doubted_and_their_own_are_not(people, reference, name):
    """A corner of the mouth on the cheek, where the others do not exclude it."""
    surface, marks = people[name]
    aside = marks["ch_r"] + 16 * (marks["go_r"] - marks["ch_r"]) / np.linalg.norm(marks["go_r"] - marks["ch_r"])
    wrong = marks | {"ch_r": surface.closest(aside[None]).points[0]}
    _check(reference, surface, wrong)
    look = finish(first_look(reference, Surface(surface.vertices, surface.triangles, 2.0), wrong))
    assert doubted(marks, look.laid) == {}
    told = doubted(wrong, look.laid)
    assert list(told) == ["ch_r"] and 11 < told["ch_r"] < 22


def test_what_is_said_of_doubted_landmarks():
    laid = {name: np.zeros(3) for name in ("ch_r", "gn", "sn", "sto", "pra_l")}
    off = {"ch_r": 19.2, "gn": 13.0, "sn": 11.0, "sto": 40.0, "pra_l": 40.0, "v": 90.0}
    told = doubted({name: np.array([away, 0.0, 0.0]) for name, away in off.items()}, laid)
    assert told == {"ch_r": 19.2, "sn": 11.0}, "chins are less sure, middles of parted lips and ears tell nothing"
    assert doubts({}) == "" and doubts({"sn": 11.0}).startswith("Check sn: it lies 11 mm from where the face")
    assert doubts(told).startswith("Check ch_r (19 mm) and sn (11 mm): they lie so far")
