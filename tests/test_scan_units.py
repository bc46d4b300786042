# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans in no unit: photogrammetry without a scale bar, statues, somebody else's idea of a unit."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh
from headshop.sim.scan.face_match import surface_samples
from headshop.sim.scan.orientation import detect, rotations
from headshop.sim.scan.units import (
    BY_FACE,
    LEAST,
    MOST,
    STEP,
    is_human,
    larger_units,
    plausible_units,
    sizes_to_try,
    unit_words,
)


@pytest.fixture(scope="module")
def skin(reference):
    """What a scanner sees of the reference."""
    seen = (reference.groups["inner"][reference.skin.triangles] < 0.5).all(axis=1)
    return Mesh.from_triangles(reference.skin.vertices, reference.skin.triangles[seen])


def test_one_of_the_sizes_to_try_is_always_near(skin):
    tried = np.array(sizes_to_try(surface_samples(skin))) * np.ptp(skin.vertices, axis=0).max()
    assert tried[0] == pytest.approx(LEAST) and MOST / STEP < tried[-1] <= MOST
    assert (tried[1:] / tried[:-1]).max() == pytest.approx(STEP)
    assert is_human(1.0) and is_human(0.8) and not is_human(1.3)
    assert not is_human(0.6) and is_human(0.6, 0.53)  # a figurine, a baby


@pytest.mark.parametrize("unit", [0.004, 19.3, 70.0, 3.1e5])
def test_a_head_in_no_unit_is_as_large_as_the_reference(skin, unit):
    """No usual unit makes these a person's; the axes are found as well."""
    scan = skin.moved((skin.vertices @ rotations()[9] + [40, -300, 10]) / unit)
    found = detect(scan)
    assert found.unit == BY_FACE and found.certain
    assert found.unit_scale == pytest.approx(unit, rel=0.04)
    np.testing.assert_array_equal(found.rotation, rotations()[9])
    assert "a guess" in found.reason


@pytest.mark.parametrize(("size", "unit"), [(0.62, "mm"), (0.66, "cm")])
def test_a_baby_is_not_blown_up(skin, size, unit):
    """A head that is a baby's in some unit may be one, whatever fits better when it is larger."""
    scan = skin.moved(size * skin.vertices / {"mm": 1.0, "cm": 10.0}[unit])
    assert detect(scan).unit == unit


@pytest.mark.parametrize("unit", [0.004, 13.7, 3.1e5])
@pytest.mark.parametrize("shift", [0.0, 1500.0])
def test_landmarks_tell_the_unit(reference, skin, unit, shift):
    """They are in mm; far from the origin, too."""
    turn = Rotation.random(random_state=4).as_matrix()
    places = {n: turn @ (p + shift) for n, p in reference.landmark_positions().items()}
    scan = skin.moved((skin.vertices + shift) @ turn.T / unit)
    assert detect(scan, places).unit_scale == pytest.approx(unit, rel=0.01)
    assert detect(scan, places, unit=1.23 * unit).unit_scale == 1.23 * unit  # told, not questioned
    elsewhere = {n: p + 400 for n, p in places.items()}
    if not plausible_units(scan):
        with pytest.raises(InputError, match="give the unit"):
            detect(scan, elsewhere)


def test_what_is_no_face_is_refused_in_any_size():
    points = np.random.default_rng(5).standard_normal((900, 3))
    points *= 1e-4 / np.linalg.norm(points, axis=1, keepdims=True)
    with pytest.raises(InputError, match="no head in mm, cm, m or inches, and no face shows its size: give the unit"):
        detect(Mesh.from_triangles(points, ConvexHull(points).simplices))


def test_units_in_words():
    assert unit_words("cm", 10.0) == "centimetres" and unit_words("custom", 13.7) == "units of 13.7 mm"
    assert unit_words(BY_FACE, 16.404) == "units of 16.4 mm, a guess that makes the head as large as most"


def test_a_room_is_read_in_the_unit_that_makes_it_one(reference):
    """3 m of floor below a head: no unit makes a head of that, nor does the face's size show."""
    floor = np.array([(-1500.0, -1500, -250), (1500, -1500, -250), (1500, 1500, -250), (-1500, 1500, -250)])
    skin = reference.skin
    triangles = np.concatenate([skin.triangles, len(skin.vertices) + np.array([(0, 1, 2), (0, 2, 3)])])
    room = Mesh.from_triangles(np.concatenate([skin.vertices, floor]), triangles)
    assert dict(larger_units(surface_samples(room))) == {"mm": 1.0}
    assert detect(room).unit == "mm"
    metres = room.moved(room.vertices / 1000)
    assert dict(larger_units(surface_samples(metres))) == {"m": 1000.0}
    assert detect(metres, reference.landmark_positions()).unit == "m"  # and not a face in inches
    with pytest.raises(InputError, match="no head"):
        detect(room.moved(room.vertices * 1e6))
