# SPDX-License-Identifier: GPL-3.0-or-later
"""Ears that are not seen: where they are, and what tells that they are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.ears import EAR_MARKS
from headshop.sim.landmarks.confidence import LIKE_AN_EAR, like_ears
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import CHANGE, REST, Expression, ShapeFit, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import (
    EDGE,
    UnderHair,
    about_ears,
    beside_face,
    ear_found,
    fit_under_hair,
    in_face,
    scalp_by_face,
)
from headshop.sim.mesh import vertex_normals
from headshop.sim.progress import finish


def without_folds(space):
    """(n, 3) mm, the reference's skin with its ears smoothed over."""
    covered = space.points.copy()
    ears = np.flatnonzero(space.ear > 0.2)
    near = cKDTree(space.points).query(space.points[ears], 60)[1]
    for _ in range(20):
        covered[ears] = covered[near].mean(axis=1)
    return covered


def test_hair_over_ears_is_smoother_than_ears(reference):
    """The landmarks of what lies as near as an ear, but has none of its folds, are not those of an ear."""
    space = shape_space(reference)
    covered = without_folds(space)
    none = np.zeros(len(space.points))
    fit = ShapeFit(space.points, none[:1], Pose(1.0, np.eye(3), none[:3], 0.0), none + 1, none, np.zeros((1, 1)))
    for points, seen in ((space.points, True), (covered, False)):
        like = like_ears(space, fit, Surface(points, space.triangles))
        assert [like[side] > LIKE_AN_EAR for side in "lr"] == [seen, seen]


def test_the_scalp_beside_a_face_without_ears_is_that_of_the_closer_fit(reference, laid):
    space = shape_space(reference)
    close, loose = laid(space, space.points), laid(space, space.points - [0.0, 0.0, 4.0])
    none = np.zeros(len(space.points), dtype=bool)
    hair = UnderHair(close, loose, none, none, ("l", "r"))
    raised = scalp_by_face(space, hair, space.hairy, {}).points[:, 2] - loose.points[:, 2]
    face = in_face(space, close, {}, 0.0) & ~space.hairy
    away = cKDTree(space.points[face]).query(space.points)[0]
    assert raised[face] == pytest.approx(4.0) and raised[away < 8].min() > 3.6
    assert raised[away > 80].max() < 0.1 and raised[space.points[:, 2].argmax()] < 0.2
    narrow = {f"zy_{side}": sign * np.array([40.0, 0.0, 0.0]) for side, sign in (("l", 1), ("r", -1))}
    picked = scalp_by_face(space, hair, space.hairy, narrow).points[:, 2] - loose.points[:, 2]
    assert picked[face & (np.abs(space.points[:, 0]) > 65)].max() < 3.8, "landmarks tell where the face ends"
    assert scalp_by_face(space, hair, ~none, {}) is loose
    for seen in ((), ("l",)):
        assert scalp_by_face(space, UnderHair(close, loose, none, none, seen), space.hairy, {}) is loose


@pytest.mark.parametrize("hidden", [(), ("l",), ("l", "r")])
def test_the_looser_fit_tells_of_ears_only_where_neither_is_seen(reference, laid, hidden):
    space = shape_space(reference)
    fit, none = laid(space, space.points), np.zeros(len(space.points), dtype=bool)
    hair = UnderHair(fit, fit, none, none, hidden)
    assert all(hair.told_by_scalp(f"{n}_{s}") == (len(hidden) == 2) for n in EAR_MARKS for s in "lr")
    assert hair.told_by_scalp("v") and hair.told_by_scalp("eu_l") and not hair.told_by_scalp("op", unseen=False)
    assert not hair.told_by_scalp("zy_l") and not hair.told_by_scalp("prn")


def test_ears_that_nothing_tells_of_lie_farther_back_and_lower_than_the_references(reference):
    """And as far as those of people do: displacements alone vary by 7 and 8 mm."""
    space = shape_space(reference)
    at = {n: k for k, n in enumerate(space.names)}
    for used in (space, space.reduced(60)):
        form, pull = (sum(each) for each in zip(*used.beside.values(), strict=True))
        system = np.eye(len(pull)) + form
        usual = np.linalg.solve(system, pull)
        for side in "lr":
            ride = [
                np.einsum("kim,k->im", used.modes[used.corners[at[f"{n}_{side}"]]], used.weights[at[f"{n}_{side}"]])
                for n in ("t", "ex")
            ]
            apart = ride[0] - ride[1]
            varies = np.sqrt(np.diag(apart @ np.linalg.solve(system, apart.T)))
            _, back, up = apart @ usual
            assert 1.0 < back < 2.5 and -2.5 < up < -1.0
            assert 3 < varies[1] < 4.5 and 1.8 < varies[2] < 3


@pytest.mark.parametrize("missing", ["", "l", "lr"])
def test_what_is_expected_of_ears_counts_where_they_are_not_seen(reference, missing):
    """Cut away or known to be under hair; those that are seen lie where they are."""
    space = shape_space(reference)
    strict = replace(space, beside={side: (10 * form, 10 * pull) for side, (form, pull) in space.beside.items()})
    at, ear = space.points, space.ear > 0.2
    gone = ear & np.isin(np.where(at[:, 0] > 0, "l", "r"), list(missing))
    whole = Surface(at, space.triangles)
    cut, hair = whole.without(gone[space.triangles].any(axis=1)), gone & ear
    pose = Pose(1.0, np.eye(3), np.zeros(3), 0.0)

    def moved(scan, hair=None):
        fits = [
            finish(fit_shape(each, scan, pose, CHANGE, None, 1, REST, None, hair)).points for each in (space, strict)
        ]
        return {side: np.abs(fits[1] - fits[0])[ear & ((at[:, 0] > 0) == (side == "l"))].max() for side in "lr"}

    for off in (moved(cut), moved(whole, hair)):
        for side in "lr":
            assert (off[side] > 0.3) == (side in missing), off
        assert missing or max(off.values()) == 0


def test_what_hair_hides_with_an_ear_is_no_face(reference, laid):
    space = shape_space(reference)
    fit = laid(space, space.points)
    hidden, face = beside_face(space, fit, "l"), in_face(space, fit, {}, EDGE)
    assert (about_ears(space, "l") & face).any() and not (hidden & face).any()
    assert (
        hidden[(space.ear > 0.5) & (space.points[:, 0] > 0)].mean() > 0.6 and not hidden[space.points[:, 0] < -40].any()
    )


def test_ears_are_seen_where_they_are_expected(reference, laid):
    space = shape_space(reference)
    fit, bare = laid(space, space.points), Surface(space.points, space.triangles)
    assert ear_found(space, fit, bare, "l") == ear_found(space, fit, bare, "r") == 1
    left = about_ears(space, "l")
    assert left[space.ear > 0.3].mean() == pytest.approx(0.5, abs=0.05) and not left[space.points[:, 0] < -40].any()
    normals = vertex_normals(space.points, space.triangles)
    hair = Surface(space.points + np.where(left[:, None], 20.0 * normals, 0), space.triangles)
    assert ear_found(space, fit, hair, "l") < 0.7 and ear_found(space, fit, hair, "r") == 1


def test_ears_of_a_head_without_hair_that_are_like_none_are_not_seen(reference, laid):
    """What was smoothed over, for one; but those that somebody picked are there."""
    space = shape_space(reference)
    fit, smooth = laid(space, space.points), without_folds(space)
    for points, given, hidden in (
        (space.points, (), ()),
        (smooth, (), ("l", "r")),
        (smooth, ("t_l",), ("r",)),
    ):
        hair = finish(fit_under_hair(space, Surface(points, space.triangles), fit, Expression(), given))
        assert not hair.covered.any() and hair.hidden == hidden
