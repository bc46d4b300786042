# SPDX-License-Identifier: GPL-3.0-or-later
"""A parted mouth of which a scan shows one side: the other one is as that."""

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.rest import rest_of
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.mouth_outline import both_sides_of, mouth_outline
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish

FORWARD = np.array([0.0, -1.0, 0.0])


@pytest.fixture(scope="module")
def open_mouth(reference):
    """The reference's skin with its mouth open as a scanner sees it, and its landmarks."""
    head = plainly_posed(reference, jaw_open=0.5)
    surface = Surface(drawn(head.skin.faces, head.skin.vertices), rest_of(reference).outer, smooth=2.0)
    return surface, head.landmark_positions()


def one_side(target, side, beyond):
    """What ``target`` shows of the left (1) or right (-1) side and so many mm ``beyond`` the middle."""
    return target.without((side * target.vertices[target.triangles][:, :, 0]).min(axis=1) < -beyond)


def seen_from(first, last, count=93):
    """Depths (count, 4) mm that are seen in the columns from ``first`` to ``last``, each column as deep as its number."""
    depth = np.repeat(np.arange(count, dtype=float)[:, None], 4, axis=1)
    depth[:first], depth[last + 1 :] = np.nan, np.nan
    return depth


@pytest.mark.parametrize(("first", "last"), [(0, 92), (16, 76), (5, 80), (30, 60)])
def test_what_is_seen_on_both_sides_or_nowhere_to_the_end_of_a_mouth_stays(first, last):
    depth = seen_from(first, last)
    same, unseen = both_sides_of(depth)
    np.testing.assert_array_equal(same, depth)
    assert not unseen.any()


def test_where_nothing_is_seen_nothing_is_made_up():
    depth, unseen = both_sides_of(np.full((93, 4), np.nan))
    assert np.isnan(depth).all() and not unseen.any()


@pytest.mark.parametrize("beyond", [20, 8, 2, -2])
def test_a_side_that_is_not_seen_is_as_the_other_from_a_little_before_the_cut(beyond):
    depth = seen_from(46 - beyond, 92)
    both, unseen = both_sides_of(depth)
    aside = 46 - np.arange(93)
    np.testing.assert_array_equal(unseen, aside > max(beyond - 4, 0))
    np.testing.assert_array_equal(both[unseen], depth[::-1][unseen])
    np.testing.assert_array_equal(both[~unseen], depth[~unseen])
    turned, too = both_sides_of(depth[::-1])
    np.testing.assert_array_equal(turned, both[::-1])
    np.testing.assert_array_equal(too, unseen[::-1])


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("beyond", [18.0, 6.0, 3.0])
def test_half_a_mouth_has_the_outline_of_a_whole_one(open_mouth, side, beyond):
    """Where the scan was cut counted as the other corner, up to 3 cm aside, or no mouth was seen."""
    target, marks = open_mouth
    whole = mouth_outline(target, marks, FORWARD)
    half = mouth_outline(one_side(target, side, beyond), marks, FORWARD)
    assert half.no_hole
    for name in ("ch_l", "ch_r"):
        assert np.linalg.norm(half.corners[name] - whole.corners[name]) < 2.5
    assert np.linalg.norm(half.lower - whole.lower) < 2.5


def test_a_face_is_fitted_to_half_an_open_mouth_as_to_a_whole_one(reference, open_mouth):
    target, _ = open_mouth
    space, laid = shape_space(reference), []
    for scan in (target, one_side(target, 1, 3.0)):
        start = finish(fit_shape(space, scan, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))
        fit, shown = finish(fit_expression(space, scan, start))
        assert shown.parted
        laid.append(space.landmarks(fit.points))
    # A middle that is seen from one side only is not known to better than a few millimetres.
    for name, off in {"ch_l": 1.5, "ch_r": 6.0, "ls": 3.0, "li": 3.0}.items():
        assert np.linalg.norm(laid[0][name] - laid[1][name]) < off
