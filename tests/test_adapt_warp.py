# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin-plate splines against their equation and against scipy; completion of landmarks."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.spatial.transform import Rotation

from headshop.sim.adapt import thin_plate_spline
from headshop.sim.adapt.completion import complete_landmarks, complete_positions
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.thin_plate_spline import System, ThinPlateSpline, WarpChain, flatness, similarity
from headshop.sim.errors import InputError


@pytest.fixture
def pairs():
    rng = np.random.default_rng(3)
    source = rng.normal(0, 60, (40, 3))
    return source, source @ (np.eye(3) + rng.normal(0, 0.1, (3, 3))) + rng.normal(0, 5, (40, 3)) + [10, 20, 30]


def test_equation_one_holds(pairs):
    source, target = pairs
    warp = ThinPlateSpline.fit(source, target)
    np.testing.assert_allclose(warp.transform(source), target, atol=1e-8)
    np.testing.assert_allclose(warp.weights.sum(axis=0), 0, atol=1e-9)
    np.testing.assert_allclose(warp.weights.T @ source, 0, atol=1e-6)
    points = np.random.default_rng(4).normal(0, 90, (7, 3))
    by_hand = [
        sum(c * np.linalg.norm(p - q) for c, q in zip(warp.weights, source, strict=True)) + warp.matrix @ p + warp.shift
        for p in points
    ]
    np.testing.assert_allclose(warp.transform(points), by_hand, atol=1e-9)


@pytest.mark.parametrize("smoothing", [0.0, 2.5])
def test_equals_scipy(pairs, smoothing):
    source, target = pairs
    points = np.random.default_rng(5).normal(0, 120, (200, 3))
    theirs = RBFInterpolator(source, target, kernel="linear", degree=1, smoothing=smoothing)(points)
    np.testing.assert_allclose(ThinPlateSpline.fit(source, target, smoothing).transform(points), theirs, atol=1e-6)


def test_an_affine_map_is_reproduced_and_metres_work_as_well(pairs):
    source, _ = pairs
    matrix = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.3], [0.05, 0.0, 1.2]])
    for scale in (1.0, 1e-3):
        warp = ThinPlateSpline.fit(source * scale, source * scale @ matrix.T + 7 * scale)
        np.testing.assert_allclose(warp.matrix, matrix, atol=1e-9)
        assert np.abs(warp.weights).max() < 1e-9


def test_blocks_do_not_change_the_result(pairs, monkeypatch):
    source, target = pairs
    points = np.random.default_rng(6).normal(0, 90, (333, 3))
    warp = ThinPlateSpline.fit(source, target)
    whole = warp.transform(points)
    monkeypatch.setattr(thin_plate_spline, "BLOCK", 400)
    np.testing.assert_allclose(warp.transform(points), whole, atol=1e-10)
    assert warp.transform(points.reshape(3, 111, 3)).shape == (3, 111, 3)


def test_one_system_serves_several_targets(pairs):
    source, target = pairs
    system = System(source, 0.5)
    for goal in (target, target[::-1]):
        np.testing.assert_allclose(
            system.solve(goal).transform(source), ThinPlateSpline.fit(source, goal, 0.5).transform(source), atol=1e-9
        )


def test_chain_is_one_after_the_other(pairs):
    source, target = pairs
    a, b = ThinPlateSpline.fit(source, target), ThinPlateSpline.fit(target, source)
    np.testing.assert_allclose(WarpChain().then(a).then(b).transform(source), source, atol=1e-6)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_landmarks_give_a_similarity(count):
    rng = np.random.default_rng(count)
    source = rng.normal(0, 50, (count, 3))
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    scale = 1.0 if count == 1 else 1.4
    turn = np.eye(3) if count == 1 else turn
    target = source @ (scale * turn).T + [5, 6, 7]
    warp = ThinPlateSpline.fit(source, target)
    np.testing.assert_allclose(warp.transform(source), target, atol=1e-8)
    np.testing.assert_allclose(warp.matrix @ warp.matrix.T, scale**2 * np.eye(3), atol=1e-8)
    assert np.linalg.det(warp.matrix) > 0


def test_coplanar_landmarks_do_not_explode():
    square = np.array([[0, 0, 0], [50, 0, 0], [0, 0, 50], [50, 0, 50], [25, 0, 20.0]])
    assert flatness(square) == 0
    warp = ThinPlateSpline.fit(square, square + [0, 3, 0] + 0.1 * square)
    assert np.linalg.norm(warp.transform(np.array([[25.0, 80.0, 25.0]])) - [27.5, 91, 27.5]) < 5


def test_similarity_knows_mirrors():
    rng = np.random.default_rng(9)
    points = rng.normal(0, 40, (10, 3))
    mirrored = points * [-1, 1, 1]
    proper, _ = similarity(points, mirrored)
    either, shift = similarity(points, mirrored, mirror=None)
    assert np.linalg.det(proper) > 0 > np.linalg.det(either)
    np.testing.assert_allclose(points @ either.T + shift, mirrored, atol=1e-9)


def test_wrong_input_is_a_programming_error(pairs):
    source, target = pairs
    with pytest.raises(ValueError, match="pair"):
        ThinPlateSpline.fit(source, target[:-1])
    with pytest.raises(ValueError, match="finite"):
        ThinPlateSpline.fit(source, target * np.nan)


def test_completion_keeps_what_is_given_and_moves_with_the_head(reference):
    rest = reference.landmark_positions()
    rng = np.random.default_rng(2)
    given = {n: rest[n] * 1.05 + rng.normal(0, 2, 3) for n in ("ex_l", "ex_r", "prn", "ch_l", "ch_r", "gn", "t_l")}
    found = complete_landmarks(reference, given)
    assert set(found) == set(rest)
    for name, place in given.items():
        np.testing.assert_array_equal(found[name], place)
    turn, shift = Rotation.from_rotvec([0.4, 1.1, -0.7]).as_matrix(), np.array([300.0, -40.0, 90.0])
    moved = complete_landmarks(reference, {n: turn @ p + shift for n, p in given.items()})
    for name in rest:
        np.testing.assert_allclose(moved[name], turn @ found[name] + shift, atol=1e-6)


def test_completion_of_exact_landmarks_is_exact(reference):
    rest = reference.landmark_positions()
    given = {n: 0.8 * rest[n] + [1, 2, 3] for n in ("ex_l", "ex_r", "prn", "gn")}
    for name, place in complete_positions(rest, given).items():
        np.testing.assert_allclose(place, 0.8 * rest[name] + [1, 2, 3], atol=1e-6)
    with pytest.raises(InputError, match="at least three"):
        complete_landmarks(reference, {n: rest[n] for n in ("prn", "gn")})


@pytest.mark.parametrize("scan", ["lps_infinite", "menpo_james", "rvcg_dummyhead"])
def test_left_out_landmarks_of_real_heads_are_found_again(shared, reference, scan):
    """Better than the plain spline with few landmarks, and never far off."""
    marks = read_landmarks(shared / "scans" / f"{scan}.landmarks.json")
    rest = reference.landmark_positions()
    rng = np.random.default_rng(11)
    ours, theirs = [], []
    for count in (6, 8, 12):
        for _ in range(6):
            some = list(rng.permutation(sorted(marks))[:count])
            others = [n for n in marks if n not in some]
            if flatness([marks[n] for n in some]) < 0.1:
                continue
            found = complete_landmarks(reference, {n: marks[n] for n in some})
            plain = ThinPlateSpline.fit([rest[n] for n in some], [marks[n] for n in some])
            ours.append(np.mean([np.linalg.norm(found[n] - marks[n]) for n in others]))
            theirs.append(np.mean([np.linalg.norm(plain.transform(rest[n][None])[0] - marks[n]) for n in others]))
    assert np.mean(ours) < np.mean(theirs) and np.mean(ours) < 10 and np.max(ours) < 18
