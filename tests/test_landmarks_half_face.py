# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans of one side of a face, as a scanner beside it or a cut through the middle leaves them: the other side is told by it."""

from types import SimpleNamespace

import numpy as np
import pytest

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.landmarks import looking, looks, placed_face
from headshop.sim.landmarks.both_sides import MIRROR
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.hidden_skin import WIDE, unseen_face, with_hidden_skin
from headshop.sim.landmarks.looks import LOOKS, PARTS, QUICK, WHOLE, templates_of
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.verdict import Verdict
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.face_match import face_template
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.ply import read_ply

SIDES = {"l": 1.0, "r": -1.0}
BEYOND = 6.0  # mm beyond the middle at which a half ends
#: Landmarks of a face that tell sides.
PAIRED = ("en", "ex", "al", "ch", "zy", "go")


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def somebody(reference):
    """Somebody's whole head, alike on both sides but for a millimetre or so, and the true landmarks (mm)."""
    field = draw_field(reference.landmark_positions(), np.random.default_rng(3))
    points = reference.skin.vertices + field(reference.skin.vertices)
    others = {name: part.vertices for name, part in reference.parts.items()}
    return reference.skin.moved(points), reference.landmarks.on(others | {"skin": points})


def half_of(mesh: Mesh, side: str, middle=(0.0, 0.0, 0.0), way=(1.0, 0.0, 0.0)) -> Mesh:
    """The ``side`` of a head to a little beyond its ``middle`` (3,), from which ``way`` (3,) leads to its left."""
    across = SIDES[side] * (mesh.vertices[mesh.triangles] - middle) @ way / np.linalg.norm(way)
    return Mesh.from_triangles(mesh.vertices, mesh.triangles[across.min(axis=1) > -BEYOND])


def without(space, hole):
    """The skin of the ``space`` as a scan without the points ``hole`` (n,) bool."""
    return Surface(space.points, space.triangles[~hole[space.triangles].any(axis=1)])


def test_left_and_right_go_together(space, reference):
    marks = reference.landmark_positions()

    def draws(name):
        k = np.linalg.norm(space.points - marks[name], axis=1).argmin()
        return space.modes[k]

    for name in ("ex", "zy", "ch"):
        left, right = draws(f"{name}_l"), draws(f"{name}_r") * MIRROR[:, None]
        together = (left * right).sum(axis=1)
        apart = np.sqrt((left**2).sum(axis=1) * (right**2).sum(axis=1))
        assert (together / apart > 0.7).all(), name
    across = [np.linalg.norm(draws(name)[0]) for name in ("n", "prn", "sn", "pg")]
    assert max(across) < 0.5 * np.linalg.norm(draws("zy_l")[0])


def test_half_a_face_is_looked_for_as_either_half(reference):
    template = face_template(reference)
    halves = [templates_of(look, template) for look in LOOKS if look.half]
    assert halves and len(LOOKS) == len(PARTS)
    for left, right in halves:
        assert (left[:, 0] > -looks.MIDDLE).all() and (right[:, 0] < looks.MIDDLE).all()
        assert all((each[0] == template[0]).all() for each in (left, right))  # the tip of the nose
        assert len(template) < len(left) + len(right) < 1.4 * len(template)
    for look in LOOKS:
        if not look.half:
            (whole,) = templates_of(look, template)
            assert whole is template


@pytest.mark.parametrize(("who", "side"), [("somebody", "l"), ("s1", "l"), ("s1", "r")])
def test_half_a_head_is_found(request, reference, somebody, who, side):
    mesh, true = somebody
    if who == "s1":  # rough, with holes: no whole face fits on half of it
        shared = request.getfixturevalue("shared")
        mesh = clean_scan(read_ply(shared / "ict" / "examples" / "s1_scan.ply"))[0]
        true = read_landmarks(shared / "ict" / "examples" / "s1_truth.json")
    turn = np.linalg.qr(np.random.default_rng(ord(side)).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    half = half_of(mesh, side, (true["ex_l"] + true["ex_r"]) / 2, true["ex_l"] - true["ex_r"])
    found = finish(find_landmarks(Mesh.from_triangles(half.vertices @ turn.T, half.triangles), reference))
    off = {n: np.linalg.norm(found.positions[n] - true[n] @ turn.T) for n in found.positions if n in true}
    other = {"l": "r", "r": "l"}[side]
    assert np.mean([off[f"{n}_{side}"] for n in PAIRED]) < 4.0
    assert np.mean([off[f"{n}_{other}"] for n in PAIRED]) < 6.0
    assert {f"{n}_{other}" for n in ("en", "ex", "ch", "zy")} <= set(found.mid_air)


@pytest.mark.parametrize(
    ("first", "share", "taken"),
    [
        (Verdict(False, 1.0, 0.9), WHOLE + 0.01, 1),
        # laid on half a face, it need not be in its place, however plain it is
        (Verdict(False, 1.0, 0.9), WHOLE - 0.01, 2),
        # hardly like a face, it waits for a thorough look all the same
        (Verdict(False, 1.0, 0.56), WHOLE + 0.01, 3),
    ],
)
def test_half_a_face_is_looked_for_where_little_of_one_is_found(
    reference, space, somebody, monkeypatch, first, share, taken
):
    looked, laid_on = [], object()

    def trials(look, *_):
        looked.append(look)
        yield Progress(0.5, "")
        return [(1.0, 1.0, laid_on, laid_on)]

    def fits(look, *_):
        yield Progress(0.5, "")
        return [(first if look in QUICK else Verdict(True, 9.0, 0.3), 1.0, laid_on, laid_on)]

    monkeypatch.setattr(looking, "_trials", trials)
    monkeypatch.setattr(looking, "_fits", fits)
    monkeypatch.setattr(placed_face, "share_of", lambda *_: share)
    _, fit, _, _ = finish(placed_face.place_face(somebody[0], reference, space, (1.0,)))
    assert looked == list(LOOKS[:taken]) and fit is laid_on
    assert [look.half for look in LOOKS[:2]] == [False, True]


@pytest.mark.parametrize(("look", "wanted"), list(zip(LOOKS, (0.7, 0.7, 0.7, 0.7, 0.8), strict=True)))
def test_further_places_must_show_as_much_of_a_face_as_in_a_thorough_look(reference, space, monkeypatch, look, wanted):
    """Whatever looks there are besides: those above a beard, of less of a face, ask for more."""
    asked, scan = [], object()

    def doubted(reference, space, fit, relief, target):
        assert target is scan
        asked.append(relief)
        return Verdict(True, 9.0, 0.3)

    monkeypatch.setattr(looking, "fit_shape", lambda *_, **__: iter(()))
    monkeypatch.setattr(looking, "lies", lambda *_: None)
    monkeypatch.setattr(looking, "judged", doubted)
    rival = 1.0, 1.0, SimpleNamespace(pose=None, coefficients=None), scan
    monkeypatch.setattr(looking, "run", lambda *_: (yield from _result(rival[2])))
    finish(looking._fits(look, reference, space, space, [rival, rival], 1))
    assert asked[:2] == [look.relief, wanted] and set(asked[2:]) == {wanted}


def _result(value):
    yield Progress(0.5, "")
    return value


def test_what_a_scan_shows_on_the_other_side_only_is_filled_in(space, laid):
    left = space.points[:, 0] > -BEYOND
    fit = laid(space, space.points)
    hidden = unseen_face(space, fit, without(space, ~left))
    assert hidden.sum() > 100 and not hidden[space.points[:, 0] > 0].any()
    assert (space.face[hidden] > 0.5).all()
    marks = space.landmarks(space.points)
    beside = (space.points[:, 0] > -14) & (space.points[:, 0] < -10) & (space.face > 0.5)
    assert hidden[beside].mean() > 0.5  # up to where the scan begins
    cheek = np.linalg.norm(space.points - (marks["zy_r"] + marks["ch_r"]) / 2, axis=1)
    assert hidden[(cheek < 20) & (space.face > 0.5) & (space.ear < 0.05)].all()
    assert not unseen_face(space, fit, without(space, cheek < WIDE - 3)).any()  # a small hole
    assert unseen_face(space, fit, without(space, cheek < 2.5 * WIDE)).any()
    both = np.abs(space.points[:, 0]) > 25
    assert not unseen_face(space, fit, without(space, both))[both].any()  # nothing tells


def test_skin_near_a_place_that_is_known_is_not_filled_in(space, laid):
    fit, target = laid(space, space.points), without(space, space.points[:, 0] < -BEYOND)
    known = space.landmarks(space.points)["ch_r"]
    near = np.linalg.norm(space.points - known, axis=1) < 18
    assert unseen_face(space, fit, target)[near].any()
    kept = unseen_face(space, fit, target, [known])
    assert kept.any() and not kept[near].any()


def test_the_other_side_is_filled_in_as_this_one_is(space, laid):
    """A cheek that is fuller than the likeliest head's is so on the side that the scan lacks, too."""
    normals = vertex_normals(space.points, space.triangles)
    marks = space.landmarks(space.points)
    full = sum(
        3.0 * np.exp(-(np.linalg.norm(space.points - (marks[f"zy_{s}"] + marks[f"ch_{s}"]) / 2, axis=1) ** 2) / 400)
        for s in SIDES
    )
    person = space.points + full[:, None] * normals
    fit = laid(space, space.points)
    shown = person[:, 0] > -BEYOND
    scan = Surface(person, space.triangles[shown[space.triangles].all(axis=1)])
    hidden = unseen_face(space, fit, scan)
    filled = with_hidden_skin(space, fit, hidden, scan)
    cheek = hidden & (full > 1.0)
    found = filled.closest(person[cheek], 10.0)
    assert cheek.sum() > 5 and found.found.all() and found.distance.mean() < 0.5 < full[cheek].mean() / 2


def test_a_head_is_built_from_half_of_it(reference, somebody):
    mesh, true = somebody
    half = half_of(mesh, "r")
    marks = {n: p for n, p in true.items() if n[-2:] != "_l" and p[0] < BEYOND and n not in ("v", "op")}
    built = finish(build_head(reference, half, marks, detail=0))
    assert built.attributes["hidden"][built.head.groups["face"] > 0.5].any()
    other = (np.asarray(built.head.groups["face"]) > 0.5) & (np.asarray(built.head.groups["inner"]) < 0.5)
    other &= built.head.skin.vertices[:, 0] > BEYOND
    off = Surface(mesh.vertices, mesh.triangles).closest(built.head.skin.vertices[other], 30.0).distance
    assert np.mean(off) < 1.6 and np.percentile(off, 95) < 4.0
    assert (built.attributes["fitted"][other] < 0.5).mean() > 0.7  # and said to be invented
