# SPDX-License-Identifier: GPL-3.0-or-later
"""The outline of a parted mouth: its corners are where the gap between the lips ends, whatever a first guess says."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import expression
from headshop.sim.landmarks.expression import lips_ajar
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.mouth_outline import (
    DOWN,
    gap_end,
    gaps_about,
    lip_rolls,
    looked_at,
    mouth_outline,
    widest_gap,
)
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.progress import finish
from headshop.sim.relax.mouth_gap import lip_edges, without_islands
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply

HALF, OPEN, RISE = 25.0, 16.0, 6.0  # mm: half the mouth's width, how far it is open, how far its corners are raised
FORWARD = np.array([0.0, -1.0, 0.0])


def _triangles(shape):
    """(m, 3) over a grid of points."""
    k = np.arange(np.prod(shape)).reshape(shape)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def _face(gap=True, teeth=False, wide=OPEN, rolled=(0.0, 0.0), noise=0.0):
    """A rounded surface with a gap in it like that between smiling lips, ``wide`` mm, and teeth behind it, if any.

    rolled : mm by which the edges of the upper and the lower lip turn in; noise : mm
    """
    x, z = np.meshgrid(np.arange(-60, 60.1, 0.8), np.arange(-60, 40.1, 0.8))
    above = z - RISE * (x / HALF) ** 2
    near = np.clip(1 - (np.abs(above) - wide / 2 * (1 - (x / HALF) ** 2)) / 4, 0, 1) ** 2
    y = x**2 / 40 + near * np.where(above > 0, *rolled)
    points = np.stack([x, y, z], axis=2).reshape(-1, 3)
    points += noise * np.random.default_rng(3).standard_normal(points.shape)
    triangles = _triangles(x.shape)
    across, _, up = points[triangles].mean(axis=1).T
    share = across / HALF
    inside = np.abs(up - RISE * share**2) < wide / 2 * (1 - share**2)
    if not gap:
        return Surface(points, triangles)
    if not teeth:
        return Surface(points, triangles[~inside])
    back = points + [0.0, 5.0, 0.0]
    return Surface(
        np.concatenate([points, back]), np.concatenate([triangles[~inside], triangles[inside] + len(points)])
    )


def _guess():
    """Landmarks as somebody might guess them: the corners half a centimetre too far out."""
    wide = HALF + 5
    places = {"ls": (0, 0, 14), "li": (0, 0, -16), "pg": (0, 0, -34), "ch_l": (wide, 20, 2), "ch_r": (-wide, 20, 2)}
    return {name: np.array(place, dtype=float) for name, place in places.items()}


@pytest.mark.parametrize("teeth", [False, True])
def test_corners_are_where_the_gap_ends(teeth):
    found = mouth_outline(_face(teeth=teeth), _guess(), FORWARD)
    for name, side in (("ch_l", 1), ("ch_r", -1)):
        assert found.corners[name] == pytest.approx([side * HALF, HALF**2 / 40, RISE], abs=2.5)
    assert found.upper == pytest.approx([0, 0, OPEN / 2], abs=1.0)
    assert found.lower == pytest.approx([0, 0, -OPEN / 2], abs=1.0)
    assert found.marks["sto"] == pytest.approx([0, 0, 0], abs=1.0)


def test_corners_are_the_same_on_a_turned_small_scan():
    face, scale = _face(), 0.8
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    small = Surface(scale * face.vertices @ turn.T, face.triangles)
    guess = {name: scale * turn @ place for name, place in _guess().items()}
    straight, found = mouth_outline(face, _guess(), FORWARD), mouth_outline(small, guess, turn @ FORWARD, scale)
    for name, place in straight.corners.items():
        assert found.corners[name] == pytest.approx(scale * turn @ place, abs=1.5)  # a column more or less


@pytest.mark.parametrize(("wide", "ajar"), [(0.0, False), (7.0, True), (OPEN, False)])
def test_lips_are_ajar_when_a_little_apart_and_what_is_wide_is_left_to_the_outline(wide, ajar):
    space = SimpleNamespace(landmarks=lambda points: _guess())
    free = SimpleNamespace(points=None, pose=Pose(1.0, np.eye(3), np.zeros(3), 0.0))
    assert lips_ajar(space, free, _face(gap=wide > 0, wide=wide)) == ajar


@pytest.mark.parametrize(
    ("fits", "teeth", "no_hole", "wide", "ajar"),
    [
        (1.0, False, False, False, True),
        (1.0, True, False, True, True),
        (1.0, False, True, True, True),
        (0.8, False, False, False, True),
        (0.7, False, False, True, True),
        (1.2, False, False, False, False),
        (1.2, True, False, True, False),
        (1.2, False, True, True, False),
    ],
)
def test_lips_are_far_apart_only_around_no_hole_where_teeth_show_or_where_closed_ones_fit_plainly_worse(
    fits, teeth, no_hole, wide, ajar, monkeypatch
):
    """A scan from above has a hole between closed lips too, where the upper one hides the edge of the lower one."""
    closed, free = SimpleNamespace(coefficients=0, pose=None), SimpleNamespace(coefficients=1, pose=None)

    def fit_shape(space, target, pose, stages, start, *_):
        yield 1.0
        return free if start else closed

    for name, answer in {
        "fit_shape": fit_shape,
        "told_of_mouth": lambda space, outline: outline,
        "line_of": lambda *_: None,
        "about_mouth": lambda space: None,
        "cost": lambda space, fit, about: fits if fit is free else 1.0,
        "lips_ajar": lambda *_: True,
        "teeth_seen": lambda *_: teeth,
    }.items():
        monkeypatch.setattr(expression, name, answer)
    for outline, parted in ((SimpleNamespace(no_hole=no_hole), wide), (None, ajar)):
        monkeypatch.setattr(expression, "outline_of", lambda *_, seen=outline: seen)
        assert finish(expression._fit_lips(SimpleNamespace(parted=1), None, closed))[1] == parted


@pytest.mark.parametrize(("teeth", "behind"), [(False, 5.0), (True, 5.0), (True, 20.0)])
def test_teeth_between_lips_are_seen(teeth, behind):
    face = _face()
    if teeth:  # crowns 6 mm high under the upper lip
        across, up = np.meshgrid(np.linspace(-14, 14, 29), np.linspace(1, 7, 7))
        crowns = np.stack([across, across**2 / 40 + behind, up], axis=2).reshape(-1, 3)
        more = _triangles(across.shape) + len(face.vertices)
        face = Surface(np.concatenate([face.vertices, crowns]), np.concatenate([face.triangles, more]))
    space = SimpleNamespace(landmarks=lambda points: _guess())
    free = SimpleNamespace(points=None, pose=Pose(1.0, np.eye(3), np.zeros(3), 0.0))
    assert expression.teeth_seen(space, free, face) == (teeth and behind < 12)


@pytest.mark.parametrize("noise", [0.0, 0.25])
@pytest.mark.parametrize(("upper", "lower"), [(0, 0), (3, 0), (0, 3), (1.5, 1.5), (5, 1.5)])
def test_lips_of_an_open_mouth_roll_in_and_edges_of_a_hole_do_not(upper, lower, noise):
    found = mouth_outline(_face(rolled=(upper, lower), noise=noise), _guess(), FORWARD)
    assert found.no_hole is (min(upper, lower) > 0)


@pytest.mark.parametrize(("wide", "rolled", "seen"), [(5.0, 1.5, True), (5.0, 0.0, False), (3.4, 1.5, False)])
def test_lips_a_few_millimetres_apart_are_parted_if_they_roll_in(wide, rolled, seen):
    """A crack as wide as the mouth: of one that noise made between closed lips, the edges are too near to each other."""
    found = mouth_outline(_face(wide=wide, rolled=(rolled, rolled)), _guess(), FORWARD)
    assert (found is not None) == seen
    if seen:
        assert found.no_hole and np.linalg.norm(found.upper - found.lower) == pytest.approx(wide, abs=1.5)


def _behind(face, lip):
    """``face`` with the edge of the ``upper`` or the ``lower`` lip, or of ``both``, going on straight back, out of sight."""
    rim = np.flatnonzero(face.gap_vertex | face.border_vertex)
    x, _, z = face.vertices[rim].T
    inner = (np.abs(x) < HALF + 1) & (np.abs(z) < OPEN / 2 + 5)
    above = z > RISE * (x / HALF) ** 2
    rim = rim[inner & {"upper": above, "lower": ~above, "both": inner}[lip]]
    place = np.full(len(face.vertices), -1)
    place[rim] = len(face.vertices) + np.arange(len(rim))
    sides = np.concatenate([face.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    known = {tuple(side) for side in sides.tolist()}
    open_ = np.array([(a, b) for a, b in sides[(place[sides] >= 0).all(axis=1)].tolist() if (b, a) not in known])
    a, b = open_.T
    more = np.concatenate([np.stack([b, a, place[a]], 1), np.stack([b, place[a], place[b]], 1)])
    back = face.vertices[rim] + [0.0, 6.0, 0.0]
    return Surface(np.concatenate([face.vertices, back]), np.concatenate([face.triangles, more]))


@pytest.mark.parametrize(("lip", "no_hole"), [("both", True), ("upper", False), ("lower", False)])
def test_a_gap_is_no_hole_where_the_scan_goes_on_behind_both_lips(lip, no_hole):
    """An infant's lower lip is foremost at its edge, seen from before: nothing of it rolls in."""
    found = mouth_outline(_behind(_face(), lip), _guess(), FORWARD)
    assert found.no_hole is no_hole


@pytest.mark.parametrize("back", [20.0, 35.0, 60.0])
def test_a_lower_lip_is_found_as_far_back_as_a_jaw_takes_it(back):
    """Of a mouth that is open in full it lies 30 mm behind the upper one."""
    face = _face(wide=30.0)
    low = np.array([0.0, back, 0.0]) * (face.vertices[:, 2:] < RISE * (face.vertices[:, :1] / HALF) ** 2)
    share = np.clip(1 - np.abs(face.vertices[:, :1]) / HALF, 0, 1) ** 0.5  # at the corners the lips meet
    guess = _guess() | {"ls": np.array([0.0, 0, 20])}
    found = mouth_outline(Surface(face.vertices + low * share, face.triangles), guess, FORWARD)
    assert (found is not None) == (back < 50)
    if found is not None:
        assert found.lower == pytest.approx([0, back, -15], abs=2.0)
        for name, side in (("ch_l", 1), ("ch_r", -1)):
            assert found.corners[name][[0, 2]] == pytest.approx([side * HALF, RISE], abs=4.0)


def test_how_far_lips_roll_in_is_measured_at_either():
    column = looked_at(_face(rolled=(3.0, 1.5)), _guess(), FORWARD, 1.0)[1]
    upper, lower = lip_rolls(column, gaps_about(column, len(column) // 2))
    assert upper == pytest.approx(2.5, abs=0.6) and lower == pytest.approx(1.25, abs=0.4)  # 3 and 1.5 at the very edge
    closed = looked_at(_face(gap=False), _guess(), FORWARD, 1.0)[1]
    assert lip_rolls(closed, gaps_about(closed, len(closed) // 2)) == (0.0, 0.0)


@pytest.mark.parametrize("neck", [False, True])
def test_a_mouth_is_found_that_is_open_to_below_where_the_chin_was_expected(neck):
    """A jaw that opened far takes the chin down with it, and a first guess may not; nor is a neck seen through it a lip."""
    face, high = _face(wide=30.0), _guess() | {"ls": np.array([0.0, 0, 20]), "pg": np.array([0.0, 0, -8])}
    if neck:
        whole = _face(gap=False)
        more = whole.triangles + len(face.vertices)
        back = whole.vertices + [0.0, 40.0, 0.0]
        face = Surface(np.concatenate([face.vertices, back]), np.concatenate([face.triangles, more]))
    found = mouth_outline(face, high, FORWARD)
    assert found.lower[2] == pytest.approx(-15, abs=1.5) and found.upper[2] == pytest.approx(15, abs=1.5)


@pytest.mark.parametrize(("half", "tall"), [(25.0, 12.0), (18.0, 34.0), (20.0, 28.0)])
def test_edges_are_found_aside_of_the_middle_too_however_round_the_mouth(half, tall):
    """On straight ways from the middle of a lip to a corner one is within the gap of a round mouth."""
    face = _face(gap=False)
    x, _, z = face.vertices[face.triangles].mean(axis=1).T
    face = Surface(face.vertices, face.triangles[(x / half) ** 2 + (2 * z / tall) ** 2 > 1])
    lip = tall / 2 + 4
    marks = {"ls": (0, 0, lip), "li": (0, 0, -lip), "ch_l": (half, half**2 / 40, 0), "ch_r": (-half, half**2 / 40, 0)}
    shares = np.linspace(-0.4, 0.4, 9)
    edges = lip_edges(face, {name: np.array(place, dtype=float) for name, place in marks.items()}, FORWARD, shares)
    height = tall / 2 * np.sqrt(1 - shares**2)
    np.testing.assert_allclose(edges[:, :, 2], np.stack([height, -height], axis=1), atol=2.0)


def test_edges_of_a_lower_lip_that_hangs_are_found_along_an_arch():
    """The half-moon of a broad smile: straight ways from the lower lip's middle to the corners are within it."""
    face, half, tall = _face(gap=False), 25.0, 12.0
    x, _, z = face.vertices[face.triangles].mean(axis=1).T
    face = Surface(face.vertices, face.triangles[(z > 0) | (z < -tall * (1 - (x / half) ** 2)) | (np.abs(x) > half)])
    marks = {
        "ls": (0, 0, 4),
        "li": (0, 0, -tall - 2),
        "ch_l": (half, half**2 / 40, 0),
        "ch_r": (-half, half**2 / 40, 0),
    }
    marks = {name: np.array(place, dtype=float) for name, place in marks.items()}
    shares = np.array([-0.3, -0.2, 0.2, 0.3])
    assert np.isnan(lip_edges(face, marks, FORWARD, shares)).all()
    edges = lip_edges(face, marks, FORWARD, shares, arched=True)
    np.testing.assert_allclose(edges[:, 0, 2], 0, atol=1.5)
    np.testing.assert_allclose(edges[:, 1, 2], -tall * (1 - shares**2), atol=1.5)


def test_closed_lips_have_no_outline():
    assert mouth_outline(_face(gap=False), _guess(), FORWARD) is None


def test_a_hole_in_few_columns_is_no_mouth():
    face = _face(gap=False)
    x, _, z = face.vertices[face.triangles].mean(axis=1).T
    hole = (np.abs(x - 1) < 1.5) & (np.abs(z) < 5)
    assert mouth_outline(Surface(face.vertices, face.triangles[~hole]), _guess(), FORWARD) is None


def test_a_hole_under_the_lower_lip_in_few_columns_is_no_mouth_either():
    face = _face()
    x, _, z = face.vertices[face.triangles].mean(axis=1).T
    hole = (np.abs(x - 1) < 2) & (np.abs(z + 18) < 3)
    found, whole = (mouth_outline(f, _guess(), FORWARD) for f in (Surface(face.vertices, face.triangles[~hole]), face))
    assert found.lower[2] == pytest.approx(whole.lower[2], abs=1.0)
    for name, place in whole.corners.items():
        assert found.corners[name] == pytest.approx(place, abs=0.1)


def test_the_lower_lip_between_a_crease_and_a_hole_under_it_is_no_tooth():
    upper, crease, hole = np.linspace(0, 3, 10), np.full(6, np.nan), np.full(10, np.nan)
    lip, teeth, chin = 5 + np.linspace(-1, 1, 20) ** 2, np.full(20, 12.0), np.full(20, 16.0)
    assert widest_gap(np.concatenate([upper, crease, lip, hole, chin])) is None
    first, last = widest_gap(np.concatenate([upper, crease, teeth, hole, chin]))
    assert (first, last) == (9, 46) and (last - first) * DOWN > 18


@pytest.mark.parametrize("touching", [False, True])
def test_teeth_hide_no_gap_where_the_lower_lip_is_far_back(touching):
    """In a smile they lie before the way from the upper lip to the lower, and here and there the scan joins them to it."""
    face = _face(wide=14.0)
    below = face.vertices[:, 2] < RISE * (face.vertices[:, 0] / HALF) ** 2
    low = np.array([0.0, 9, 0]) * below[:, None] * np.clip(1 - np.abs(face.vertices[:, :1]) / HALF, 0, 1) ** 0.5
    across, up = np.meshgrid(np.linspace(-18, 6, 61), np.linspace(-9, 9, 46))  # but for those on the left
    teeth = np.stack([across, across**2 / 40 + 5.5, up], axis=2).reshape(-1, 3)
    share, more = across.ravel() / HALF, _triangles(across.shape)
    from_edges = 7 * (1 - share**2) - np.abs(up.ravel() - RISE * share**2)
    lower = up.ravel() < RISE * share**2
    bridge = (from_edges > 1.5) | (touching & lower & (np.abs(across.ravel() + 6) < 0.7))
    more = more[bridge[more].all(axis=1)] + len(face.vertices)
    whole = Surface(np.concatenate([face.vertices + low, teeth]), np.concatenate([face.triangles, more]))
    found = mouth_outline(whole, _guess(), FORWARD)
    assert found.upper[2] == pytest.approx(7, abs=1.5) and found.lower[2] == pytest.approx(-7, abs=1.5)
    for name, side in (("ch_l", 1), ("ch_r", -1)):
        assert found.corners[name][[0, 2]] == pytest.approx([side * HALF, RISE], abs=4.0)


def test_what_hardly_any_skin_joins_to_the_rest_is_an_island():
    skin = np.zeros((60, 60))
    assert without_islands(skin) is skin
    skin[10:50, 20:40] = np.nan  # the mouth
    teeth = skin.copy()
    teeth[20:40, 24:36] = 4.0
    np.testing.assert_array_equal(without_islands(teeth), skin)
    teeth[30:32, 20:40] = 4.0  # two columns that reach either lip
    kept = without_islands(teeth)
    assert np.isnan(kept[20:40, 26:34]).all() and np.isfinite(kept[np.isfinite(skin)]).all()
    teeth[20:40, 24:40] = 0.5  # as wide as they are: a lip
    np.testing.assert_array_equal(np.isfinite(without_islands(teeth)), np.isfinite(teeth))
    teeth[20:40, 24:40] = 4.0  # but it lies far back
    assert np.isnan(without_islands(teeth)[20:40, 24:39]).all()


def test_what_hangs_before_the_skin_is_no_island_and_no_end_of_the_gap():
    depth = np.zeros((60, 60))
    depth[10:50, 25:40] = np.nan  # the mouth
    flaked = depth.copy()
    flaked[18:21, 15:24] = -4.0
    np.testing.assert_array_equal(without_islands(flaked), flaked)
    assert gap_end(without_islands(flaked), 30, 24, 40, -1)[0] == 10
    flaked[18:21, 15:24] = 4.0  # behind it: seen through a hole
    assert np.isnan(without_islands(flaked)[18:21, 15:24]).all()
    depth[20:40, 29:36] = -4.0  # in the mouth it hangs before nothing
    assert np.isnan(without_islands(depth)[20:40, 29:36]).all()
    depth[20:40, 29:36] = np.nan
    depth[:, 40:] = 6.0
    depth[20:40, 34:40] = 1.0  # nor do teeth that reach a lower lip far back: elsewhere there is nothing beside them
    assert np.isnan(without_islands(depth)[20:40, 34:40]).all()


@pytest.mark.parametrize(
    ("low", "half", "rolled", "seen"),
    [(0, 25, 1.5, True), (14, 25, 1.5, True), (14, 25, 0, False), (14, 13, 1.5, False)],
)
def test_a_mouth_is_found_above_where_it_was_expected_if_it_is_one(low, half, rolled, seen):
    """The furrow under the lower lip lacks data too. A gap elsewhere is a mouth's if it is wide and lips roll in around it."""
    face = _face(gap=False, wide=10.0, rolled=(rolled, rolled))
    x, _, z = face.vertices.T
    lip = np.exp(-(((z + 9.5) / 3.5) ** 2) - (x / 20) ** 2)[:, None]
    full = face.vertices - [0, 3, 0] * lip
    x, _, z = full[face.triangles].mean(axis=1).T
    furrow = (x / 9) ** 2 + ((z + 17) / 3) ** 2 < 1
    mouth = (np.abs(z - RISE * (x / HALF) ** 2) < 5 * (1 - (x / HALF) ** 2)) & (np.abs(x) < half)
    guess = {name: place - [0, 0, low] for name, place in _guess().items()}
    found = mouth_outline(Surface(full, face.triangles[~furrow & ~mouth]), guess, FORWARD)
    assert (found is not None) == seen
    if seen:
        assert found.upper[2] == pytest.approx(5, abs=1.5) and found.lower[2] == pytest.approx(-5, abs=1.5)


def test_a_speck_beside_the_mouth_does_not_widen_it():
    depth = np.zeros((60, 60))
    depth[20:40, 20:40] = np.nan  # the mouth
    depth[40:45, 29:31] = np.nan  # a crack of 1 mm that goes on from its corner
    assert gap_end(depth, 30, 19, 40, 1) == (39, 19, 40)
    assert gap_end(depth, 30, 19, 40, -1) == (20, 19, 40)


@pytest.mark.parametrize("name", ["s1", "s2"])
def test_corners_of_smiling_subjects(shared, reference, name):
    scan = shared / "ict" / "examples" / f"{name}_smile_scan.ply"
    if not scan.is_file():
        pytest.skip(f"no {scan.name} in {scan.parent}")
    truth = json.loads(scan.with_name(f"{name}_smile_truth.json").read_text(encoding="utf-8"))["landmarks"]
    found = finish(find_landmarks(clean_scan(read_ply(scan))[0], reference))
    assert max(np.linalg.norm(found.positions[mark] - truth[mark]) for mark in ("ch_l", "ch_r", "sto")) < 3.0
    assert "sto" in found.mid_air and "sto" not in found.sure()
