# SPDX-License-Identifier: GPL-3.0-or-later
"""The line of closed lips: it is as long as the mouth is wide, which no shape of a neutral head tells."""

import json

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks.expression import told_of_lips
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.lip_line import (
    ASIDE,
    FADING,
    PLAIN,
    WIDE,
    LipLine,
    fading_ends,
    line_ends,
    lip_line,
    missing_run,
)
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import CHANGE, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply

HALF, RISE = 22.0, 3.0  # mm: half the mouth's width, how far its corners are raised
FORWARD = np.array([0.0, -1.0, 0.0])


def _face(deep=2.0, slit=False, noise=0.0, speck=False, hole=False, ends=(-40.0, -40.0), half=HALF):
    """A rounded surface with a crease in it like that between closed lips, ``deep`` mm, or a ``slit`` without data; with
    ``noise`` mm, a ``speck`` without data 12 mm beyond the left corner, and a ``hole`` about the right one; it ends so many mm
    below the line's middle about that corner, and elsewhere; the crease is seen for ``half`` mm to either side."""
    x, z = np.meshgrid(np.arange(-60, 60.1, 0.5), np.arange(-40, 40.1, 0.5))
    high = z - RISE * (x / HALF) ** 2
    along = np.clip((half - np.abs(x)) / 3, 0, 1)
    y = (
        x**2 / 40
        + deep * along * np.exp(-((high / 1.0) ** 2))
        + noise * np.random.default_rng(3).standard_normal(x.shape)
    )
    points = np.stack([x, y, z], axis=2).reshape(-1, 3)
    k = np.arange(x.size).reshape(x.shape)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    across, _, up = points[triangles].mean(axis=1).T
    gone = slit & (np.abs(up - RISE * (across / HALF) ** 2) < 0.8) & (np.abs(across) < HALF)
    gone |= speck & (np.hypot(across - HALF - 12, up - RISE * ((HALF + 12) / HALF) ** 2) < 1.5)
    gone |= hole & (np.hypot(across + HALF, up - RISE) < 12)
    gone |= up < np.where(across < -15, *ends)
    return Surface(points, triangles[~gone])


def _guess(wide=0.0, high=0.0):
    """Landmarks as a first fit might have them: the corners so much too far out, all of them so much too high."""
    half = HALF + wide
    places = {"sto": (0, 0, high), "ch_l": (half, half**2 / 40, high), "ch_r": (-half, half**2 / 40, high)}
    return {name: np.array(place, dtype=float) for name, place in places.items()}


@pytest.mark.parametrize(
    "seen", [{}, {"slit": True}, {"noise": 0.1}, {"slit": True, "noise": 0.1, "speck": True}, {"deep": 4.0}]
)
@pytest.mark.parametrize("guess", [(8.0, 0.0), (-6.0, 3.0), (0.0, -4.0)])
def test_corners_are_where_the_line_ends(seen, guess):
    found = lip_line(_face(**seen), _guess(*guess), FORWARD)
    for name, side in (("ch_l", 1), ("ch_r", -1)):
        assert found.corners[name] == pytest.approx([side * HALF, HALF**2 / 40, RISE], abs=2.0)
    assert found.middle[[0, 2]] == pytest.approx([0, 0], abs=1.0)


def test_corners_are_the_same_on_a_turned_small_scan():
    face, scale = _face(), 0.8
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    small = Surface(scale * face.vertices @ turn.T, face.triangles)
    guess = {name: scale * turn @ place for name, place in _guess(4.0).items()}
    straight, found = lip_line(face, _guess(4.0), FORWARD), lip_line(small, guess, turn @ FORWARD, scale)
    for name, place in straight.marks.items():
        assert found.marks[name] == pytest.approx(scale * turn @ place, abs=0.6)


def test_a_corner_in_a_hole_is_not_told():
    found = lip_line(_face(slit=True, hole=True), _guess(4.0), FORWARD)
    assert set(found.corners) == {"ch_l"}
    assert found.corners["ch_l"] == pytest.approx([HALF, HALF**2 / 40, RISE], abs=2.0)


@pytest.mark.parametrize("end", [-4.0, -6.0])
def test_no_line_goes_on_along_the_end_of_a_scan(end):
    found = lip_line(_face(ends=(end, end)), _guess(4.0), FORWARD)
    assert found.middle[[0, 2]] == pytest.approx([0, 0], abs=1.0)
    for name, side in (("ch_l", 1), ("ch_r", -1)):
        assert found.corners[name] == pytest.approx([side * HALF, HALF**2 / 40, RISE], abs=2.0)


@pytest.mark.parametrize(("near", "told"), [(2.4, {"ch_l"}), (4.5, {"ch_l", "ch_r"})])
def test_a_corner_at_the_end_of_a_scan_is_not_told(near, told):
    found = lip_line(_face(ends=(RISE - near, -40.0)), _guess(4.0), FORWARD)
    assert set(found.corners) == told


def test_a_line_as_short_as_no_mouth_tells_where_it_is_but_not_how_wide():
    """That of a coarse mannequin is plain in the middle only."""
    found = lip_line(_face(half=15.0), _guess(4.0), FORWARD)
    assert not found.corners and set(found.marks) == {"sto"}
    assert found.middle[[0, 2]] == pytest.approx([0, 0], abs=1.0)
    assert set(lip_line(_face(half=19.5), _guess(4.0), FORWARD).corners) == {"ch_l", "ch_r"}
    assert lip_line(_face(half=11.0), _guess(4.0), FORWARD) is None


def test_what_is_missing_to_the_end_of_a_column_may_go_on_beyond():
    depth = np.array([[1.0, np.nan, np.nan, 2.0, np.nan], [np.nan, 1.0, 1.0, np.nan, 1.0]])
    missing = missing_run(depth)
    assert missing[0, :4].tolist() == [0, 2, 2, 0] and missing[1, 1:].tolist() == [0, 0, 1, 0]
    assert missing[0, 4] >= 5 and missing[1, 0] >= 5


def test_what_of_the_mouth_shows_through_the_slit_is_not_where_lips_meet():
    face, behind = _face(slit=True), 14.0  # mm
    corners = np.array([[-2.0, behind, -1.5], [2.0, behind, -1.5], [2.0, behind, 1.5], [-2.0, behind, 1.5]])
    speck = np.array([[0, 1, 2], [0, 2, 3]]) + len(face.vertices)
    through = Surface(np.concatenate([face.vertices, corners]), np.concatenate([face.triangles, speck]))
    for surface in (face, through):
        assert lip_line(surface, _guess(4.0, 1.0), FORWARD).middle == pytest.approx([0, 0, 0], abs=1.0)


@pytest.mark.parametrize("noise", [0.0, 0.15])
def test_smooth_skin_has_no_line(noise):
    assert lip_line(_face(deep=0.0, noise=noise), _guess(), FORWARD) is None


def test_neither_a_weak_place_nor_a_speck_beyond_ends_a_line():
    worth = np.zeros(101)
    worth[20:81] = PLAIN + 0.4
    worth[60:66] = PLAIN - 0.5
    worth[90:92] = PLAIN + 0.4
    assert line_ends(worth) == (80, 20)


def test_a_line_that_fades_goes_on_to_the_corner_of_the_shape_and_no_farther():
    """As between lips that a phone fused in voxels of two millimetres: it is plain in the middle only."""
    aside = np.arange(-WIDE, WIDE + ASIDE / 2, ASIDE)
    fading = np.interp(np.abs(aside), [0, 14, 16, 30, 34], [1.2, 1.2, PLAIN - 0.05, FADING + 0.1, 0.0])
    assert 14 < aside[line_ends(fading)[0]] < 16.5
    ends = aside[fading_ends(fading, aside, [25.0, 20.0])]
    np.testing.assert_allclose(ends, [25.0, -20.0])
    far = aside[fading_ends(fading, aside, [40.0, 40.0])]
    np.testing.assert_allclose(np.abs(far), 31.0, atol=ASIDE)
    short = aside[fading_ends(fading, aside, [5.0, 5.0])]
    np.testing.assert_array_equal(short, aside[list(line_ends(fading))])


def test_a_line_that_goes_on_far_beyond_the_corner_of_the_shape_tells_none():
    """As a furrow in a beard does: one corner 24 mm beyond its place, and the whole face was refused."""
    assert lip_line(_face(half=40.0), _guess(-4.0), FORWARD) is None
    assert lip_line(_face(half=30.0), _guess(-4.0), FORWARD).corners.keys() == {"ch_l", "ch_r"}


def test_a_line_that_ends_at_the_rim_of_what_is_looked_at_goes_on_no_farther():
    aside = np.arange(-WIDE, WIDE + ASIDE / 2, ASIDE)
    assert fading_ends(np.full(len(aside), 1.2), aside, [60.0, 60.0]) == [len(aside) - 1, 0]


def test_the_skin_follows_the_line(reference):
    """Of a mouth narrower than the face lets expect, the fit itself has its corners where the line has them."""
    space = shape_space(reference)
    rest = space.landmarks(space.points)
    line = LipLine({n: rest[n] * [0.75, 1, 1] + moved(n) for n in ("ch_l", "ch_r")}, rest["sto"] + moved("sto"))
    target = Surface(space.points, space.triangles)
    pose = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
    start = _run(fit_shape(space, target, pose, CHANGE))
    fit = _run(fit_shape(space, target, pose, CHANGE, told=told_of_lips(space, start, line)))
    for name in ("ch_l", "ch_r"):
        goal = line.corners[name] - moved(name)
        before, after = (np.linalg.norm(space.landmarks(f.points)[name] - goal) for f in (start, fit))
        assert after < 0.7 * before  # the scan here says otherwise


def _run(work):
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


@pytest.mark.parametrize("name", ["lps_infinite", "rvcg_dummyhead"])
def test_corners_of_scanned_mouths(shared, reference, name):
    scan = shared / "scans" / f"{name}.ply"
    if not scan.is_file():
        pytest.skip(f"no {scan.name} in {scan.parent}")
    truth = json.loads(scan.with_name(f"{name}.landmarks.json").read_text(encoding="utf-8"))["landmarks"]
    found = finish(find_landmarks(clean_scan(read_ply(scan))[0], reference)).positions
    assert max(np.linalg.norm(found[mark] - truth[mark]) for mark in ("ch_l", "ch_r", "sto")) < 2.0
