# SPDX-License-Identifier: GPL-3.0-or-later
"""A mouth that hair led astray is looked for again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import find
from headshop.sim.landmarks import mouth_beside_hair as again_of
from headshop.sim.landmarks.mouth_beside_hair import with_mouth_again
from headshop.sim.landmarks.shape_fit import REST, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import UnderHair
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import Progress, finish

ASTRAY = 11.0  # mm


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def curtained(reference, space):
    """Curtains of hair over ears and sides: the scan, and the points of the skin (n,) bool under them."""
    skin, marks = reference.skin, reference.landmark_positions()
    whole = drawn(skin.faces, skin.vertices)
    outer = skin.triangles[~(reference.groups["inner"] > 0.5)[skin.triangles].any(axis=1)]

    def beside(points):
        return (np.abs(points[:, 0]) > 55) & (points[:, 1] > marks["t_l"][1] - 25) | (points[:, 2] > marks["tr"][2])

    thick = np.where(beside(whole), 25.0, 0.0)[:, None] * vertex_normals(whole, outer)
    return Surface(whole + thick, outer), beside(space.points)


@pytest.fixture(scope="module")
def astray(space, laid):
    """A fit whose mouth lies too high."""
    away = np.linalg.norm(space.points - space.landmarks(space.points)["sto"], axis=1)
    return laid(space, space.points + np.exp(-((away / 30) ** 2))[:, None] * [0.0, 0.0, ASTRAY])


def mouth_off(space, points):
    """mm by which the landmarks of a mouth are off the reference's."""
    truth, laid = space.landmarks(space.points), space.landmarks(points)
    return max(np.linalg.norm(laid[n] - truth[n]) for n in ("ls", "sto", "li", "ch_l", "ch_r"))


def test_a_mouth_that_lies_amiss_beside_hair_is_found_again(space, curtained, astray, monkeypatch):
    scan, covered = curtained
    known = []
    monkeypatch.setattr(again_of, "fit_shape", lambda *told: known.append(told[-1]) or fit_shape(*told))
    assert mouth_off(space, astray.points) > 8
    again = finish(work_of(space, scan, UnderHair(astray, astray, covered, covered, ("l", "r")), REST))
    assert mouth_off(space, again.points) < 4
    assert known[0][covered].all() and known[0][space.ear > 0.5].mean() > 0.6 and known[0].mean() < 0.6


def work_of(*told):
    """`with_mouth_again`, which yields the fraction done, as work."""
    work = with_mouth_again(*told)
    while True:
        try:
            done = next(work)
        except StopIteration as end:
            return end.value
        yield Progress(done, "")


def test_no_mouth_is_looked_for_that_is_in_place_open_or_beside_no_hair(space, curtained, astray, laid):
    scan, covered = curtained
    right = laid(space, space.points)
    none = np.zeros_like(covered)
    for fit, hair, shown in (
        (right, covered, REST),
        (astray, none, REST),
        (astray, covered, replace(REST, parted=True)),
    ):
        assert finish(work_of(space, scan, UnderHair(fit, fit, hair, hair, ()), shown)) is None


def test_where_lips_meet_nowhere_the_mouth_stays(space, curtained, astray):
    scan, covered = curtained
    smooth, mouth = scan.vertices.copy(), space.landmarks(space.points)["sto"]
    lips = np.flatnonzero(np.linalg.norm(smooth - mouth, axis=1) < 35)
    around = cKDTree(smooth).query(smooth[lips], 40)[1]
    for _ in range(15):
        smooth[lips] = smooth[around].mean(axis=1)
    hair = UnderHair(astray, astray, covered, covered, ("l", "r"))
    assert finish(work_of(space, Surface(smooth, scan.triangles), hair, REST)) is None


def test_landmarks_are_those_of_the_mouth_that_was_found_again(reference, space, curtained, laid, monkeypatch):
    marked, asked = laid(space, space.points), []

    def again(*told):
        yield 1.0
        return marked

    def under_hair(space, target, fit, shown, fringe):
        asked.append(fit)
        yield 1.0
        none = np.zeros(len(space.points), dtype=bool)
        return UnderHair(fit, fit, none, none, ())

    monkeypatch.setattr(find, "with_mouth_again", again)
    monkeypatch.setattr(find, "fit_under_hair", under_hair)
    scan = curtained[0]
    finish(find.find_landmarks(Mesh.from_triangles(scan.vertices, scan.triangles), reference))
    assert len(asked) == 2 and asked[1] is marked
