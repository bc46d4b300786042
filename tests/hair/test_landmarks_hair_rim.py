# SPDX-License-Identifier: GPL-3.0-or-later
"""Where hair rises from the forehead, its step is no skin."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks import skin_left
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.hair_rim import BESIDE, RIM, rim_of_hair
from headshop.sim.landmarks.hidden_skin import EARLESS
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import in_face
from headshop.sim.mesh import vertex_normals
from headshop.sim.progress import finish

HIGHEST = 40.0  # mm above the brows from which on there is hair


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def hair(space):
    """(n,) bool: hair above the forehead and behind the ears."""
    marks = space.landmarks(space.points)
    high = space.points[:, 2] > marks["sci_l"][2] + HIGHEST
    return high | ((space.points[:, 1] > marks["pa_l"][1] + 10) & (space.points[:, 2] > marks["gn"][2]))


def finer(triangles, fields):
    """Each of ``triangles`` (t, 3) in four, and ``fields`` (n, d) at the old vertices and the new."""
    ends, n = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), len(fields)
    side, which = np.unique(ends, axis=0, return_inverse=True)
    ab, bc, ca = n + which.reshape(-1, 3).T
    a, b, c = triangles.T
    triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return triangles, np.concatenate([fields, fields[side].mean(axis=1)])


def looked_at(space, hair, fit, rise, where=None, given=None, bare=None, strands=None):
    """What `rim_of_hair` says of the reference's skin with 12 mm of hair, and ``rise`` mm higher ``where`` (n,) bool, or
    everywhere: the share of what rises so of a scan that is taken for hair, and the points (n,) bool of the skin below.

    strands : (k, 3) -> (k,) bool, which of such places rise; then the share of what does not is told as well
    """
    triangles, fields = space.triangles, np.c_[space.points, vertex_normals(space.points, space.triangles)]
    for _ in range(2):
        triangles, fields = finer(triangles, fields)
    points, normals = fields[:, :3], fields[:, 3:]
    nearest = cKDTree(space.points).query(points)[1]
    rises = np.ones(len(points), dtype=bool) if where is None else where[nearest]
    step = rises if strands is None else rises & strands(points)
    high = np.where(hair[nearest], 12.0, rise * step)
    scan = Surface(points + high[:, None] * normals, triangles)
    bare = space.ear > EARLESS if bare is None else bare
    rising, below = rim_of_hair(space, fit, scan, hair, hair, bare, given or {})
    up, flat = (
        (step == does)[triangles].all(axis=1) & (rises & ~hair[nearest])[triangles].all(axis=1)
        for does in (True, False)
    )
    return (rising[up].mean(), below) if strands is None else (rising[up].mean(), rising[flat].mean(), below)


def beside(space, hair):
    """(n,) bool: skin beside hair, ears apart."""
    away = cKDTree(space.points[hair]).query(space.points)[0]
    return (away < RIM) & ~hair & (space.ear < EARLESS)


def test_a_step_at_the_hairline_is_hair_outside_of_the_faces_outline(space, hair, laid):
    fit = laid(space, space.points)
    outline, rim = in_face(space, fit, {}, BESIDE), beside(space, hair)
    assert (rim & ~outline).sum() > 25 and (rim & outline).sum() > 8
    rising, below = looked_at(space, hair, fit, 3.0, rim & ~outline)
    assert below[rim & ~outline].mean() > 0.9 and rising > 0.9
    assert not below[~rim].any() and not (below & hair).any()
    rising, below = looked_at(space, hair, fit, 3.0, rim & outline)
    assert not below[outline].any() and rising < 0.1, "there it may be skin"


def test_within_the_outline_it_takes_a_higher_step(space, hair, laid):
    fit = laid(space, space.points)
    rim = beside(space, hair) & in_face(space, fit, {}, BESIDE)
    rising, below = looked_at(space, hair, fit, 9.0, rim)
    assert below[rim].mean() > 0.7 and rising > 0.8


def test_what_lies_between_strands_goes_with_them_where_those_are_most_of_it(space, hair, laid):
    """And single ones go alone."""
    fit = laid(space, space.points)
    rim = beside(space, hair) & ~in_face(space, fit, {}, BESIDE)

    def dense(points):
        return np.sin(points[:, 2] * 2 * np.pi / 14) > -0.5

    def single(points):  # between points of the skin
        first, second = cKDTree(space.points).query(points, 2)[0].T
        return second - first < 2.0

    up, between, below = looked_at(space, hair, fit, 4.0, rim, strands=dense)
    assert up > 0.85 and between > 0.7 and below[rim].mean() > 0.7
    up, between, below = looked_at(space, hair, fit, 1.45, rim, strands=single)
    assert up > 0.4 and between < 0.1 and not below[rim].any()


def test_skin_goes_on_beside_hair_as_it_lies_before_it(space, hair, laid):
    """A head that is as much higher all over as the step would be has no step."""
    rising, below = looked_at(space, hair, laid(space, space.points), 3.0)
    assert below.mean() < 0.01 and rising < 0.01


def test_no_hair_no_rim(space, hair, laid):
    fit = laid(space, space.points)
    rising, below = rim_of_hair(
        space, fit, Surface(space.points, space.triangles), hair & False, hair & False, space.ear > 0.2, {}
    )
    assert not rising.any() and not below.any()


def test_what_is_not_to_be_looked_at_is_not(space, hair, laid):
    fit, rim = laid(space, space.points), beside(space, hair)
    assert looked_at(space, hair, fit, 9.0, rim)[1].any()
    assert not looked_at(space, hair, fit, 9.0, rim, bare=rim)[1].any()


def test_landmarks_tell_where_the_face_ends(space, hair, laid):
    """Above a trichion that was picked low a low step is hair; below one that was picked high it is skin."""
    fit, place = laid(space, space.points), space.landmarks(space.points)["tr"]
    rim = beside(space, hair) & (np.abs(space.points[:, 0]) < 30) & (space.points[:, 1] < place[1] + 20)
    for picked, least, most in ((-40.0, 0.7, 1.0), (15.0, 0.0, 0.0)):
        below = looked_at(space, hair, fit, 3.0, rim, {"tr": place + [0.0, 0.0, picked]})[1]
        assert least <= below[rim].mean() <= most


def test_what_rises_to_hair_is_left_out_of_a_scan_and_filled_in(reference, space, monkeypatch):
    given = {n: p for n, p in reference.landmark_positions().items() if n in SKIN and n not in ("v", "op")}
    scan = Surface(space.points, space.triangles)
    place = space.points[cKDTree(space.points).query(given["ft_l"])[1]]
    patch = np.linalg.norm(space.points - place, axis=1) < 20
    asked = []

    def rim(told, fit, target, hair, out, bare, marks):
        asked.append((bare, marks))
        near = np.linalg.norm(target.vertices[target.triangles] - place, axis=2).max(axis=1) < 20
        return near, patch

    monkeypatch.setattr(skin_left, "rim_of_hair", rim)
    look = finish(first_look(reference, scan, given))
    assert look.target.closest(place[None], 60.0).distance[0] > 5 > 2 > look.filled.closest(place[None]).distance[0]
    assert set(space.vertices[patch]) <= set(look.hidden) and look.left_out["hair"] > 500
    bare, marks = asked[0]
    assert bare[space.ear > 0.5].all() and bare.mean() < 0.3 and marks is given
    kept = finish(first_look(reference, scan, given, leave_out=("glasses", "beard")))
    assert kept.left_out["hair"] == 0 and len(asked) == 1
