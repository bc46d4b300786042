# SPDX-License-Identifier: GPL-3.0-or-later
"""Units and axes: found from the face, decided by landmarks, overridden by the artist, never silently wrong."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh
from headshop.sim.scan.orientation import axis_names, detect, rotations
from headshop.sim.scan.ply import read_ply
from headshop.sim.scan.units import BY_FACE, UNITS, plausible_units


@pytest.fixture(scope="module")
def skin(reference):
    """The reference's skin without what no scanner sees, a little tilted, as another person of smaller size."""
    seen = (reference.groups["inner"][reference.skin.triangles] < 0.5).all(axis=1)
    tilt = np.linalg.qr(np.eye(3) + 0.12 * np.array([[0, 1, -0.6], [-1, 0, 0.5], [0.6, -0.5, 0]]))[0]
    tilt *= np.sign(np.diag(tilt))
    return Mesh.from_triangles(0.93 * reference.skin.vertices @ tilt.T + [30, -20, 400], reference.skin.triangles[seen])


def _in(mesh, unit, turn):
    """The mesh as a file in another unit and with other axes would hold it."""
    return mesh.moved(mesh.vertices @ turn / UNITS[unit])


def test_there_are_24_rotations():
    turns = rotations()
    assert len({tuple(np.rint(t).astype(int).ravel()) for t in turns}) == 24
    np.testing.assert_allclose([np.linalg.det(t) for t in turns], 1)
    np.testing.assert_array_equal(turns[0], np.eye(3))


@pytest.mark.parametrize(
    ("unit", "number", "names"), [("mm", 0, ("+Z", "-Y")), ("m", 4, ("+Y", "+Z")), ("in", 9, None), ("cm", 23, None)]
)
def test_a_head_is_recognised_in_any_unit_and_position(skin, unit, number, names):
    turn = rotations()[number]
    scan = _in(skin, unit, turn)
    found = detect(scan)
    assert found.certain and found.unit == unit and found.unit_scale == UNITS[unit]
    np.testing.assert_allclose(found.apply(scan.vertices), skin.vertices, atol=1e-9)
    np.testing.assert_allclose(found.inverse(found.apply(scan.vertices)), scan.vertices, atol=1e-9)
    homogeneous = np.column_stack([scan.vertices, np.ones(len(scan.vertices))])
    np.testing.assert_allclose((homogeneous @ found.matrix.T)[:, :3], skin.vertices, atol=1e-9)
    if names:
        assert (found.up, found.front) == names and found.up in found.reason and found.front in found.reason


@pytest.mark.parametrize("number", [4, 17])
def test_landmarks_decide(reference, skin, number):
    turn = rotations()[number]
    positions = reference.landmark_positions()
    near = {n: positions[n] * 0.93 + [30, -20, 400] for n in ("prn", "ex_l", "ex_r", "gn", "t_l")}
    scan = _in(skin, "m", turn)
    found = detect(scan, {n: p @ turn for n, p in near.items()})
    assert found.certain and found.unit == "m" and "landmarks" in found.reason
    np.testing.assert_array_equal(found.rotation, turn)
    np.testing.assert_allclose(found.turn({n: p @ turn for n, p in near.items()})["gn"], near["gn"])


def test_the_landmarks_are_believed_even_against_the_shape(reference, skin):
    positions = reference.landmark_positions()
    over = np.diag([-1.0, 1, -1])  # landmarks of a head standing on its crown
    found = detect(skin, {n: p @ over for n, p in positions.items()})
    assert (found.up, found.front) == ("-Z", "-Y")


def test_the_reason_names_whose_landmarks_they_are(reference, skin):
    places = reference.landmark_positions()
    assert detect(skin, places).reason.endswith(": the landmarks say so.")
    assert detect(skin, places, picked=False).reason.endswith(": the landmarks that were found say so.")
    over = detect(skin, places, up="-Z")
    assert not over.certain and "but by the landmarks the head is turned by" in over.reason


def _turned(skin, reference, turn):
    """The skin and the landmarks of a head that ``turn`` would set upright."""
    places = {name: p @ turn for name, p in reference.landmark_positions().items()}
    return skin.moved(skin.vertices @ turn), places


def _angle(turn):
    return np.degrees(np.arccos((np.trace(turn) - 1) / 2))


@pytest.mark.parametrize("seed", [1, 4, 12])
def test_a_head_turned_as_nobody_holds_it_is_set_upright(reference, skin, seed):
    turn = Rotation.random(random_state=seed).as_matrix()
    assert min(_angle(turn.T @ r) for r in rotations()) > 35
    scan, places = _turned(skin, reference, turn)
    found = detect(scan, places)
    np.testing.assert_allclose(found.rotation, turn, atol=1e-6)
    np.testing.assert_allclose(found.inverse(found.apply(scan.vertices)), scan.vertices)
    assert found.certain and "degrees to stand upright and face forward: the landmarks say so." in found.reason
    nearest = min(rotations(), key=lambda r: _angle(turn.T @ r))
    assert (found.up, found.front) == axis_names(nearest)


@pytest.mark.parametrize("held", [-20.0, 15.0])
def test_who_stands_at_an_angle_is_turned_about_the_vertical_and_holds_the_head_as_before(reference, skin, held):
    angle, nod = Rotation.from_euler("z", 45, degrees=True), Rotation.from_euler("x", held, degrees=True)
    turn = rotations()[4].T @ (angle * nod).as_matrix()  # of +Y up
    scan, places = _turned(skin, reference, turn.T)
    found = detect(scan, places)
    np.testing.assert_allclose(found.rotation @ turn, nod.as_matrix(), atol=1e-6)
    assert found.up == "+Y" and found.certain and "turned by 45 degrees" in found.reason


def test_a_face_that_looks_along_what_was_told_to_be_up_is_not_turned_about_it(reference, skin):
    scan, places = _turned(skin, reference, Rotation.from_euler("zx", [50, 88], degrees=True).as_matrix())
    told = detect(scan, places, up="+Z")
    assert not told.certain and any(np.array_equal(told.rotation, r) for r in rotations())


def test_a_head_held_aside_stays_so_and_what_was_told_stays_up(reference, skin):
    aside = Rotation.from_euler("zx", [20, 20], degrees=True).as_matrix()
    assert np.array_equal(detect(*_turned(skin, reference, aside)).rotation, np.eye(3))
    loose = detect(*_turned(skin, reference, aside), unit=1.0, called=BY_FACE)
    np.testing.assert_allclose(loose.rotation, aside, atol=1e-6)
    lying = Rotation.from_euler("yz", [45, 50], degrees=True).as_matrix()
    scan, places = _turned(skin, reference, lying)
    told = detect(scan, places, up="+Z")
    np.testing.assert_allclose(told.rotation[2], [0, 0, 1])
    assert not told.certain and "but by the landmarks" in told.reason
    both = detect(scan, places, up="+Z", front="-Y")
    assert np.array_equal(both.rotation, np.eye(3)) and not both.certain
    looks = detect(scan, places, front="-Y")
    assert np.array_equal(looks.rotation[1], [0, 1, 0])


def test_a_unit_that_makes_no_head_is_refused_although_it_is_told(skin):
    for unit in (1e-300, "m"):
        with pytest.raises(InputError, match="which is no head"):
            detect(skin, unit=unit)


def test_what_is_told_is_not_questioned(skin):
    told = detect(skin, unit="cm", up="y", front="-X")
    assert (told.unit_scale, told.up, told.front, told.certain) == (10.0, "+Y", "-X", True)
    assert "as told" in told.reason
    scale = detect(skin, unit=0.5, up="+Z", front="-Y")
    assert scale.unit == "custom" and scale.unit_scale == 0.5
    half = detect(_in(skin, "mm", rotations()[4]), up="+Y")
    assert (half.up, half.front, half.certain) == ("+Y", "+Z", True)


def test_a_ball_is_no_face_and_it_says_so(reference):
    points = np.random.default_rng(5).standard_normal((4000, 3))
    points *= 100 / np.linalg.norm(points, axis=1, keepdims=True)
    found = detect(Mesh.from_triangles(points, np.arange(3999).reshape(-1, 3)))
    assert not found.certain and "unsure" in found.reason


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"unit": "furlong"}, "is no unit"),
        ({"unit": -3}, "is no unit"),
        ({"up": "W"}, "is no axis"),
        ({"up": "+Z", "front": "-Z"}, "two different axes"),
    ],
)
def test_wrong_overrides(reference, skin, options, says):
    with pytest.raises(InputError, match=says):
        detect(skin, **options)


def test_somebody_from_head_to_foot_is_in_metres(skin):
    points, low = skin.vertices / 1000, skin.vertices.min(axis=0) / 1000
    feet = low + [[0, 0, -1.4], [0.1, 0, -1.4], [0.0, 0.1, -1.4]]
    mesh = Mesh.from_triangles(
        np.concatenate([points, feet]), np.concatenate([skin.triangles, [[len(points) + k for k in range(3)]]])
    )
    assert plausible_units(mesh) == {"m": 1000.0}
    assert plausible_units(skin) == {"mm": 1.0}


@pytest.mark.parametrize("name", ["lps_infinite", "menpo_james", "fran_cyberware", "rvcg_dummyhead"])
def test_real_scans_saved_as_gltf(shared, reference, name):
    mesh = read_ply(shared / "scans" / f"{name}.ply")
    scan = _in(mesh, "m", rotations()[4])
    found = detect(scan)
    assert (found.unit, found.up, found.front, found.certain) == ("m", "+Y", "+Z", True)
