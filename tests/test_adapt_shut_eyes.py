# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes scanned shut: told as such, shut at rest on the surface that is drawn, opened by their levators."""

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.eyeballs import gaze_turn, place_eye
from headshop.sim.adapt.follow import follow
from headshop.sim.adapt.openings import closed_eyes
from headshop.sim.adapt.rest import rest_of
from headshop.sim.adapt.shut_eyes import with_shut_eyes
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.pose_search import Pose as Place
from headshop.sim.landmarks.shape_fit import Expression, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh_subdivision import drawn, smoother
from headshop.sim.progress import finish
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.viewpoint import Viewpoint, depth_map
from headshop.sim.tissue.lid_targets import lid_targets
from headshop.sim.tissue.model import build_model

BOTH = ("l", "r")


@pytest.fixture(scope="module")
def blinking(reference):
    """The skin (n, 3) mm of somebody else than the reference, the lids shut."""
    skin = with_shut_eyes(reference, BOTH).skin.vertices
    return skin + draw_field(reference.landmark_positions(), np.random.default_rng(5))(skin)


@pytest.fixture(scope="module")
def shut(reference, blinking):
    """The head under that skin, as a fit leaves it: a slit of a millimetre between the lids of one eye, those of the other
    as far over each other."""
    skin = blinking.copy()
    for side, slit in (("l", 1.0), ("r", -1.0)):
        skin[:, 2] += 0.5 * slit * (reference.groups[f"lid_upper_{side}"] - reference.groups[f"lid_lower_{side}"])
    return finish(follow(with_shut_eyes(reference, BOTH), skin)).head


def _seen_of_eyes(head, yaw, pitch):
    """mm² of the eyeballs that are seen from there."""
    operator, quads = smoother(head.skin.faces, len(head.skin.vertices))
    points, triangles = [operator @ head.skin.vertices], [np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]
    skin = len(triangles[0])
    for part in ("eye_l", "eye_r"):
        triangles.append(head.parts[part].triangles + sum(map(len, points)))
        points.append(head.parts[part].vertices)
    middle = np.mean([eye.centre + eye.radius * eye.gaze for eye in head.eyes], axis=0)
    camera = Viewpoint.around(middle, yaw, pitch, 600.0, 0.15, 110.0, 40.0)
    seen = depth_map(camera, np.concatenate(points), np.concatenate(triangles)).triangle
    return 0.15**2 * (seen >= skin).sum()


def test_nothing_of_the_eyeballs_is_seen_between_lids_fitted_shut(reference, shut):
    assert _seen_of_eyes(reference, 0, 0) > 100
    for yaw, pitch in ((0, 0), (0.7, 0), (-0.7, 0), (0, -0.5), (0, 0.3)):
        assert _seen_of_eyes(shut, yaw, pitch) < 0.5


def test_levators_open_them_from_the_iris_lower_rim_to_a_little_under_its_upper_one(shut):
    """In the middle of the eye; half of it is half as far."""
    model, slits = build_model(shut), []
    for value in (0.5, 1.0):
        asked = control(model, Pose({f"levator_palpebrae_{side}": value for side in "lr"}))
        skin = shut.skin.vertices.copy()
        for lids, (upper, lower) in zip(model.lids, asked.lids, strict=True):
            skin[lids.column] = lid_targets(lids, upper, lower, np.zeros(2))
        for eye, side in zip(shut.eyes, "lr", strict=True):
            (margin,) = rest_of(shut).at_iris[side]
            upper = np.flatnonzero(rest_of(shut).rim & (shut.groups[f"lid_upper_{side}"] > 0.5))
            across = np.cross(eye.gaze, [0, 0, 1.0])
            upper = upper[np.abs((skin[upper] - eye.centre) @ across) < 3]
            up = np.array([0, 0, 1.0]) - eye.gaze[2] * eye.gaze
            low, high = ((skin[rows] - eye.centre) @ up for rows in (margin, upper))
            slits.append(high.max() - low.min())
            if value == 1:
                assert 0.5 < eye.iris_radius - high.max() < 3.5
                assert abs(eye.iris_radius + low.min()) < 1.5
    assert slits[:2] == pytest.approx(np.array(slits[2:]) / 2, abs=1.2)


def test_a_blink_leaves_shut_lids_as_they_are(shut):
    for lids in build_model(shut).lids:
        moved = lid_targets(lids, 1.0, 1.0, np.zeros(2)) - lid_targets(lids, 0.0, 0.0, np.zeros(2))
        assert np.linalg.norm(moved, axis=1).max() < 0.3


def test_shut_eyes_do_not_open_by_looking_up(shut):
    for lids in build_model(shut).lids:
        up, ahead = (lid_targets(lids, 0.0, 0.0, np.array([0.0, rise])) for rise in (0.4, 0.0))
        assert np.linalg.norm((up - ahead)[lids.weight > 0.9], axis=1).max() < 1.0


def test_lids_picked_side_by_side_are_shut(reference):
    marks = {name: p for name, p in reference.landmark_positions().items() if name in SKIN}
    assert closed_eyes(reference, marks, marks) == []
    picked = marks | {"ps_l": marks["pi_l"] + [3.5, 0.5, 0.5], "ps_r": marks["pi_r"] + [0.0, 0.0, 5.0]}
    assert closed_eyes(reference, picked, picked) == ["l"]


def test_a_lower_lid_that_hangs_draws_the_eye_down_and_both_look_the_same_way(reference):
    head = with_shut_eyes(reference, BOTH)
    rest, skin = rest_of(head), head.skin.vertices
    eye, margin = reference.eyes[0], rest.at_iris["l"]
    assert len(margin) == 1
    hanging = skin - np.outer(2.0 * reference.groups["lid_lower_l"], [0, 0, 1.0])
    placed = [
        place_eye(eye, lambda x: x, np.eye(3), skin, lids, rest.lids("l"), rest.inner, rows, 1.0)
        for lids, rows in ((hanging, margin), (hanging, ()), (skin, margin))
    ]
    assert placed[0].centre[2] < placed[1].centre[2] - 0.3
    np.testing.assert_allclose(placed[2].centre, eye.centre, atol=1e-6)
    c, s = np.cos(0.1), np.sin(0.1)
    inward = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turn = gaze_turn(reference.eyes, (lambda x: x @ inward.T, lambda x: x @ inward))
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-9)


def test_shut_eyes_of_somebody_else_are_told(reference, blinking):
    space = shape_space(reference)
    target = Surface(drawn(reference.skin.faces, blinking), rest_of(reference).outer)
    fit = finish(fit_shape(space, target, Place(1.0, np.eye(3), np.zeros(3), 0.0)))
    assert finish(fit_expression(space, target, fit))[1] == Expression(False, BOTH)
