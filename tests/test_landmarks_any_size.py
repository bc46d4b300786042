# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of scans in no known unit: the face is found in any size, and its head is made a person's, unless it is one."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import any_size, looks, placed_face
from headshop.sim.landmarks.any_size import face_of_any_size, of_human_size, of_most
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.infant import infant_space
from headshop.sim.landmarks.looking import lies
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import ShapeFit
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.verdict import ODD, Verdict, judged
from headshop.sim.mesh import Mesh
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.units import plausible_units, sizes_to_try

FACE = "prn n sn gn en_l en_r ex_l ex_r al_l al_r ch_l ch_r".split()


def _off(found, truth, turn, size):
    """mm on a head of ``size`` by which the landmarks of a face are off, on average."""
    return np.mean([np.linalg.norm(found.positions[n] - size * turn @ truth[n]) for n in FACE])


@pytest.mark.parametrize(
    ("unit", "scales", "size"),
    [
        (70.0, (), 1.0),  # no usual unit makes it a head
        (1 / 1.4, (1.0,), 1.0),  # one does, of a size that no one has
        (10 / 0.55, (10.0,), 1.0),  # as small as a baby's, with a grown face
        (1 / 0.9, (1.0,), 0.9),  # somebody with a small head
    ],
)
def test_a_turned_head_in_no_unit(reference, unit, scales, size):
    skin, turn = reference.skin, Rotation.random(random_state=3).as_matrix()
    seen = (reference.groups["inner"][skin.triangles] < 0.5).all(axis=1)
    scan = Mesh.from_triangles(skin.vertices @ turn.T / unit, skin.triangles[seen])
    found = finish(find_landmarks(scan, reference, scales, any_size=True))
    assert found.unit_scale == pytest.approx(size * unit, rel=0.03)
    assert found.unit_scale in scales or size == 1.0
    assert _off(found, reference.landmark_positions(), turn, found.unit_scale / unit) < 2.0


def test_what_is_told_is_not_questioned(reference):
    skin = reference.skin
    found = finish(find_landmarks(skin.moved(1.3 * skin.vertices), reference, (1.0,)))
    assert found.unit_scale == 1.0


PLAIN = Verdict(False, 2.0, 0.9)


def _result(space, size, verdict=PLAIN, scale=1.0):
    """A face of ``size``, of the reference's, in a scan of ``scale`` mm per unit."""
    points, nothing = size * space.points, np.zeros(len(space.points))
    fit = ShapeFit(points, nothing[:3], Pose(size, np.eye(3), nothing[:3], 0.0), nothing + 1, nothing, nothing)
    return verdict, scale, fit, Surface(points, space.triangles), space


@pytest.mark.parametrize(
    ("size", "baby", "human"),
    [
        (1.0, False, True),
        (0.75, False, True),
        (1.3, False, False),
        (0.6, False, False),
        (0.6, True, True),
        (0.5, True, False),
    ],
)
def test_a_small_head_is_a_persons_if_its_face_is_a_babys(reference, size, baby, human):
    space, asked = shape_space(reference), []
    grown = judged(reference, space, _result(space, 1.0)[2], looks.THOROUGH.relief)

    def or_infant(given, less):
        verdict, _, fit, target, _ = given
        assert verdict == pytest.approx(grown) and less == 1.0  # whatever its size
        most = infant_space(reference, space).size
        assert lies(space, fit).scale == pytest.approx(most) == fit.pose.scale
        assert np.ptp(target.vertices, axis=0) == pytest.approx(most * np.ptp(space.points, axis=0))
        asked.append(given)
        yield Progress(0.5, "")
        return object() if baby else given

    assert finish(of_human_size(reference, _result(space, size), size, or_infant)) is human
    assert bool(asked) == (size == 0.6)


@pytest.mark.parametrize(("size", "human"), [(0.6, True), (0.5, False), (1.3, False)])
def test_a_head_found_as_a_babys_needs_no_other_look(reference, size, human):
    result = _result(infant_space(reference, shape_space(reference)), size)
    assert finish(of_human_size(reference, result, size, None)) is human


@pytest.mark.parametrize(
    ("verdict", "share", "units", "sized"),
    [
        (PLAIN, 1.0, (), True),
        (PLAIN, 1.0, (8.0,), True),  # a head of 1.6
        (PLAIN, 1.0, (8.0, 4.5), False),  # of 0.9 in the second unit
        (Verdict(True, 2.0, 0.9), 1.0, (), False),
        (Verdict(False, ODD + 0.1, 0.9), 1.0, (), False),
        (Verdict(False, 2.0, looks.PLAIN - 0.01), 1.0, (), False),
        (PLAIN, looks.WHOLE - 0.01, (), False),
    ],
)
def test_only_a_plain_face_of_no_persons_size_tells_the_unit(reference, monkeypatch, verdict, share, units, sized):
    space = shape_space(reference)

    def looked(look, mesh, reference, space, template, scales, split):
        assert look is looks.ANY_SIZE and scales == sizes_to_try(mesh.vertices)
        yield Progress(0.5, "")
        worse = Verdict(True, 20.0, 0.3)
        return [_result(space, 1.0, worse, 9.0), _result(space, 0.8, verdict, 4.0), _result(space, 1.0, worse, 2.0)]

    monkeypatch.setattr(any_size, "looked", looked)
    monkeypatch.setattr(any_size, "surface_samples", lambda mesh: mesh.vertices)
    monkeypatch.setattr(any_size, "share_of", lambda *_: share)
    scale, closer = finish(face_of_any_size(reference.skin, reference, space, None, units, None))
    assert scale == (pytest.approx(4.0 / 0.8) if sized else None)
    assert closer == [4.0, 9.0]  # the least bad first, and no more


def test_a_baby_in_no_unit_becomes_as_large_as_most_babies(reference):
    grown = shape_space(reference)
    infants = infant_space(reference, grown)
    assert of_most(_result(grown, 1.6, scale=2.0)) == pytest.approx(2.0 / 1.6)
    assert of_most(_result(infants, 1.6, scale=2.0)) == pytest.approx(2.0 / 1.6 * infants.size)


def test_units_are_those_of_a_head(reference):
    assert plausible_units(reference.skin) == {"mm": 1.0}
    assert plausible_units(reference.skin.moved(reference.skin.vertices / 1e4)) == {}
    assert plausible_units(reference.skin, "0.37") == {"custom": 0.37}


def test_what_is_seen_at_a_second_look_in_no_unit_is_brought_to_most_peoples_size(reference, monkeypatch):
    """Half a face, say: it is looked for at the likeliest sizes, none of which is known to be its own."""
    space, asked = shape_space(reference), []

    def looked(look, mesh, reference, space, template, scales, split):
        asked.append((look, scales))
        yield Progress(0.5, "")
        return [_result(space, 0.9, PLAIN, 4.0)] if look is not looks.LOOKS[0] else []

    def sized(*_):
        yield Progress(0.5, "")
        return None, [4.0, 6.0]

    monkeypatch.setattr(placed_face, "looked", looked)
    monkeypatch.setattr(placed_face, "face_of_any_size", sized)
    monkeypatch.setattr(placed_face, "share_of", lambda *_: 1.0)
    finish(placed_face.place_face(reference.skin, reference, space, (), any_size=True))
    first, half = looks.LOOKS[:2]
    brought = pytest.approx([4.0 / 0.9])
    assert asked == [(first, ()), (half, [4.0, 6.0]), (first, brought), (half, brought)]
