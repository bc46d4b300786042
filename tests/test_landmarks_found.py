# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks found without help: in any turn and unit, on whole and on damaged heads, and refused where no face is."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.anatomy.landmark_names import SKIN, mirrored
from headshop.sim.errors import InputError
from headshop.sim.landmarks import find, looking, placed_face, verdict
from headshop.sim.landmarks.find import better_of, find_landmarks
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import ShapeFit, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.verdict import Verdict, judged, share_of
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import drawn, smoother
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.ply import read_ply

EARS_AND_BACK = ("v", "op", "tr", "eu", "t", "sa", "sba", "pra", "pa", "obs", "obi")
FACE = [n for n in SKIN if n.partition("_")[0] not in EARS_AND_BACK]


@pytest.fixture(scope="module")
def person(reference):
    """Somebody else than the reference, and the true landmarks (mm)."""
    field = draw_field(reference.landmark_positions(), np.random.default_rng(3))
    skin = reference.skin.vertices
    points = skin + field(skin)
    return reference.skin.moved(points), reference.landmarks.on({"skin": points} | _others(reference))


def _others(reference):
    return {name: part.vertices for name, part in reference.parts.items() if name != "skin"}


def _turned(mesh: Mesh, seed: int):
    """The mesh turned and shifted at random; the rotation and shift."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = 300 * rng.standard_normal(3)
    return mesh.moved(mesh.vertices @ turn.T + shift), turn, shift


def test_landmarks_of_a_turned_person_in_metres(person, reference):
    mesh, truth = person
    turned, turn, shift = _turned(mesh, 1)
    found = finish(find_landmarks(turned.moved(turned.vertices / 1000), reference, (1.0, 1000.0)))
    assert found.unit_scale == 1000.0
    off = {n: np.linalg.norm(found.positions[n] - (turn @ truth[n] + shift)) for n in SKIN}
    assert np.mean([off[n] for n in FACE]) < 2.5
    assert np.mean(list(off.values())) < 4.0
    for n in FACE:
        if n.endswith("_l"):
            other = turn @ truth[mirrored(n)] + shift
            assert off[n] < np.linalg.norm(found.positions[n] - other)
    assert not found.missing
    assert np.mean([found.confidence[n] for n in FACE]) > 0.6


@pytest.fixture(scope="module")
def outside(person, reference):
    """What a scanner sees of that person, with sides of 2 to 3 mm: (vertices, triangles)."""
    rows, quads = smoother(reference.skin.faces, len(reference.skin.vertices), 2)
    seen = (rows @ reference.groups["inner"] < 0.5)[quads].all(axis=1)
    mesh = Mesh(rows @ person[0].vertices, quads[seen])
    return mesh.vertices, mesh.triangles


def test_a_face_is_found_though_single_triangles_are_missing_everywhere(person, outside, reference):
    vertices, triangles = outside
    there = np.random.default_rng(5).random(len(triangles)) > 0.1
    found = finish(find_landmarks(Mesh.from_triangles(vertices, triangles[there]), reference))
    assert np.mean([np.linalg.norm(found.positions[n] - person[1][n]) for n in FACE]) < 3.0
    assert not found.missing and not {"prn", "en_l", "en_r", "sn", "gn"} & set(found.mid_air)


def test_of_two_heads_beside_each_other_all_landmarks_are_on_one(person, outside, reference):
    vertices, triangles = outside
    other = vertices + [350.0, 5.0, 20.0]
    both = np.concatenate([triangles, triangles + len(vertices)])
    found = finish(find_landmarks(Mesh.from_triangles(np.concatenate([vertices, other]), both), reference))
    shift = [350.0, 5.0, 20.0] if found.positions["prn"][0] > 175 else np.zeros(3)
    assert max(np.linalg.norm(p - person[1][n] - shift) for n, p in found.positions.items()) < 25.0


def test_what_a_damaged_scan_inside_out_does_not_show_is_in_mid_air_and_unsure(person, reference):
    mesh, truth = person
    turned, turn, shift = _turned(mesh, 2)
    upright = (turned.vertices - shift) @ turn
    front = (upright[:, 1] < -20)[turned.triangles].all(axis=1)
    right_cheek = (np.linalg.norm(upright - truth["ch_r"], axis=1) < 22)[turned.triangles].any(axis=1)
    rest = Mesh.from_triangles(turned.vertices, turned.triangles[front & ~right_cheek][:, ::-1])
    found = finish(find_landmarks(rest, reference))
    off = {n: np.linalg.norm(p - (turn @ truth[n] + shift)) for n, p in found.positions.items()}
    assert np.mean([off[n] for n in FACE if n in off]) < 3.0
    hidden = {"op", "pa_l", "pa_r", "ch_r"}
    assert hidden <= set(found.mid_air) | set(found.missing)
    assert not {"prn", "en_l", "en_r", "ch_l", "sn"} & (set(found.mid_air) | set(found.missing))
    seen = min(found.confidence[n] for n in ("prn", "en_l", "en_r", "sn"))
    assert all(found.confidence.get(n, 0.0) < 0.6 * seen for n in hidden)
    assert "op" not in found.sure() and "prn" in found.sure()


@pytest.mark.parametrize("seed", [1115, 1815, 4])
def test_a_small_head_cut_off_above_the_brows_is_found_in_any_turn(reference, shared, seed):
    mesh, turn, shift = _turned(clean_scan(read_ply(shared / "ct_headsq" / "skin.ply"))[0], seed)
    found = finish(find_landmarks(mesh, reference))
    true = read_landmarks(shared / "ct_headsq" / "skin.landmarks.json")
    off = {n: np.linalg.norm(found.positions[n] - (turn @ p + shift)) for n, p in true.items() if n in found.positions}
    assert np.mean(list(off.values())) < 6.0
    assert np.mean([off[n] for n in FACE if n in off]) < 4.0


def test_eyes_with_holes_are_open_though_their_lids_have_lost_their_edges(reference):
    """A scanner that loses the eyes loses the edges of the upper lids with them; the lids are not shut for that."""
    skin = reference.skin
    vertices, marks = drawn(skin.faces, skin.vertices), reference.landmark_positions()
    seen = (reference.groups["inner"] < 0.5)[skin.triangles].all(axis=1)
    middle = vertices[skin.triangles].mean(axis=1)
    for side in "lr":
        eye = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2 + [0, 0, 5.0]
        seen &= (((middle - eye)[:, [0, 2]] / [18.0, 9.0]) ** 2).sum(axis=1) > 1
    found = finish(find_landmarks(Mesh.from_triangles(vertices, skin.triangles[seen]), reference, (1.0,)))
    for side in "lr":
        height = (marks[f"ps_{side}"] - marks[f"pi_{side}"])[2]
        assert (found.positions[f"ps_{side}"] - found.positions[f"pi_{side}"])[2] > 0.7 * height


def test_of_two_places_a_face_fits_as_well_the_likelier_shape_is_better(reference):
    space = shape_space(reference)
    n, m = len(space.points), space.modes.shape[2]
    pose = Pose(1.0, np.eye(3), np.zeros(3), 0.0)

    def bad(coefficients):
        fit = ShapeFit(space.points, coefficients, pose, np.ones(n), np.full(n, 1.0), np.zeros((m, 1)))
        return judged(reference, space, fit, 0.5)

    usual, odd = bad(np.full(m, 0.5)), bad(np.full(m, 1.5))
    assert usual.likeness == odd.likeness and not usual.doubtful and not odd.doubtful
    assert odd.bad > 2 * usual.bad


@pytest.mark.parametrize(
    "misfit, likeness, spread, share, size, face",
    [
        (1.0, 0.96, 0.5, 1.0, 1.0, True),
        (1.3, 0.67, 0.6, 0.9, 1.0, True),  # hair down to the brows
        (3.0, 0.77, 1.2, 0.6, 1.0, False),
        (2.5, 0.77, 1.3, 0.7, 1.0, True),  # cut off, and with a tube in the mouth
        (2.5, 0.70, 1.3, 0.7, 1.0, False),  # a bumpy ball
        (2.0, 0.6, 0.8, 0.8, 1.0, False),  # a neck
        (2.5, 0.74, 2.0, 0.8, 1.0, False),  # a tiny face on a nose
        (3.9, 0.98, 0.3, 0.4, 1.0, True),  # nothing but eyes, nose and mouth
        (5.5, 0.98, 0.3, 0.1, 1.0, False),
        (1.0, 0.5, 0.1, 1.0, 1.0, False),
        (2.7, 0.9, 1.3, 0.67, 0.89, True),  # seen from 28 degrees beside it
        (3.4, 0.93, 1.04, 0.61, 0.77, True),  # a child seen from 34 degrees beside it
        (3.3, 0.876, 0.68, 0.53, 0.96, True),  # cut off all round, noisy and with holes
        (4.7, 0.92, 0.59, 0.34, 0.88, True),  # cut off all round, with holes, seen from 34 degrees beside it
        (4.9, 0.91, 1.05, 0.36, 0.81, False),  # a neck again
        (3.1, 0.904, 1.18, 0.53, 0.98, False),  # a chin on a mouth
        (1.3, 0.737, 2.0, 0.93, 0.7, False),  # the side of a head
        (1.9, 0.714, 0.9, 0.75, 1.34, False),  # half a face, upside down
        (2.0, 0.68, 0.75, 0.7, 1.15, True),  # the same, upright
    ],
)
def test_what_is_taken_for_a_face(reference, monkeypatch, misfit, likeness, spread, share, size, face):
    monkeypatch.setattr(verdict, "misfit_of", lambda *_: misfit)
    monkeypatch.setattr(verdict, "likeness_of", lambda *_: likeness)
    monkeypatch.setattr(verdict, "share_of", lambda *_: share)
    fit = ShapeFit(None, np.full(10, spread), Pose(size, np.eye(3), np.zeros(3), 0.0), None, None, None)
    assert judged(reference, SimpleNamespace(size=1.0), fit, 0.53).doubtful != face


@pytest.mark.parametrize(
    "misfit, likeness, spread, ears, face",
    [
        (3.28, 0.88, 1.4, (0.0, 0.89), True),  # half of somebody unlike most
        (3.16, 0.85, 1.6, (0.9, 0.1), True),  # the same, noisy and cut off above the brows
        (2.99, 0.93, 1.43, (0.82, 0.0), True),
        (3.22, 0.91, 1.43, (0.3, 0.2), False),  # a chin on a mouth: no ear is in its place
        (3.16, 0.85, 1.6, (0.78, 0.1), False),
        (3.0, 0.78, 1.4, (0.9, 0.9), False),  # hardly like a face
        (5.2, 0.95, 0.5, (0.9, 0.1), False),  # next to nothing of one
        (3.2, 0.85, 2.0, (0.9, 0.1), False),  # nobody looks like that
    ],
)
def test_an_ear_in_its_place_tells_half_a_face(reference, monkeypatch, misfit, likeness, spread, ears, face):
    scan = Surface(np.eye(3), [[0, 1, 2]])

    def like(space, fit, target):
        assert target is scan
        return dict(zip("lr", ears, strict=True))

    monkeypatch.setattr(verdict, "misfit_of", lambda *_: misfit)
    monkeypatch.setattr(verdict, "likeness_of", lambda *_: likeness)
    monkeypatch.setattr(verdict, "share_of", lambda *_: 0.54)
    monkeypatch.setattr(verdict, "like_ears", like)
    fit = ShapeFit(None, np.full(10, spread), Pose(1.0, np.eye(3), np.zeros(3), 0.0), None, None, None)
    assert judged(reference, SimpleNamespace(size=1.0), fit, 0.7, scan).doubtful != face
    assert judged(reference, SimpleNamespace(size=1.0), fit, 0.7).doubtful


def test_the_share_of_a_face_is_that_of_its_area_which_found_the_scan(reference):
    space = shape_space(reference)
    face, left = space.face > 0.5, space.points[:, 0] > 0

    def share(found):
        return share_of(space, ShapeFit(None, None, None, None, np.where(found, 0.1, np.nan), None))

    assert share(face) == 1.0 and share(~face) == 0.0
    assert 0.4 < share(face & left) < 0.6
    assert share(face & left) + share(face & ~left) == pytest.approx(1.0)


def test_a_known_size_holds_a_head_to_it(reference):
    """A tenth too large, the scan is followed where nothing is known of its size, and not where that is known to a hair."""
    space = shape_space(reference).reduced(10)
    scan = Surface(1.1 * reference.skin.vertices, reference.skin.triangles)
    start = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
    free, held = (finish(fit_shape(space, scan, start, every=3, size=size)).pose.scale for size in (None, 1e-4))
    assert abs(free - 1.1) < 0.03 and abs(held - 1.0) < 0.005


def _seen_from(scan, toward, slope):
    """The triangles of ``scan`` whose normals have ``slope`` and more in the direction ``toward`` (3,)."""
    a, b, c = (scan.vertices[scan.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    seen = normals @ toward > slope * np.linalg.norm(normals, axis=1)
    return Mesh.from_triangles(scan.vertices, scan.triangles[seen])


@pytest.mark.parametrize("degrees, slope", [(28, 0.3), (35, 0.25)])
def test_a_face_that_one_scanner_saw_from_the_side_is_found(reference, shared, degrees, slope):
    """Where the skin slopes away from it there is nothing: a third of the face."""
    scan = clean_scan(read_ply(shared / "makehuman" / "mh_african-male-young.ply"))[0]
    whole = finish(find_landmarks(scan, reference)).positions
    seen = _seen_from(scan, [np.sin(np.radians(degrees)), -np.cos(np.radians(degrees)), 0.0], slope)
    found = finish(find_landmarks(seen, reference))
    off = [np.linalg.norm(found.positions[n] - whole[n]) for n in FACE if n in found.sure()]
    assert len(off) > 15 and np.mean(off) < 5.0


def test_a_face_that_one_scanner_saw_from_above_is_found(reference, shared):
    """Much of that scan is the top of the head and shoulders, on which a face lies nearer than on the foreshortened face."""
    scan = clean_scan(read_ply(shared / "makehuman" / "mh_caucasian-female-young.ply"))[0]
    seen = _seen_from(scan, [0.0, -np.cos(np.radians(40)), np.sin(np.radians(40))], 0.3)
    found = finish(find_landmarks(clean_scan(seen)[0], reference))
    tip = scan.vertices[scan.vertices[:, 1].argmin()]
    assert np.linalg.norm(found.positions["prn"] - tip) < 4.0
    assert found.positions["gn"][2] < tip[2] - 40 and found.positions["en_l"][0] > 8


def test_a_crop_from_brows_to_mouth_is_found_upright(reference, shared):
    scan = clean_scan(read_ply(shared / "scans" / "fran_cyberware.ply"))[0]
    height = scan.vertices[scan.triangles].mean(axis=1)[:, 2]
    crop = Mesh.from_triangles(scan.vertices, scan.triangles[(height > -70.0) & (height < 68.0)])
    found = finish(find_landmarks(crop, reference)).positions
    true = read_landmarks(shared / "scans" / "fran_cyberware.landmarks.json")
    names = ("n", "prn", "sn", "en_l", "en_r", "ex_l", "ex_r", "ch_l", "ch_r")
    assert np.mean([np.linalg.norm(found[n] - true[n]) for n in names if n in true]) < 6.0


def test_where_there_are_only_flat_ends_no_face_is_found(reference):
    """A box of a head's size: there none is looked for."""
    across = np.linspace(-1.0, 1.0, 25)
    u, v = (a.ravel() for a in np.meshgrid(across, across))
    row, column = (a.ravel() for a in np.mgrid[:24, :24])
    quads = 25 * row + column
    quads = np.stack([quads, quads + 1, quads + 26, quads + 25], axis=1)
    sides = [
        np.roll(np.stack([np.full_like(u, s), s * u, v], axis=1), k, axis=1) for k in range(3) for s in (-1.0, 1.0)
    ]
    box = Mesh(np.concatenate(sides) * [75.0, 90.0, 120.0], np.concatenate([quads + 625 * k for k in range(6)]))
    with pytest.raises(InputError, match="No face is found"):
        finish(find_landmarks(box, reference))


def test_a_ball_is_no_face_however_thorough_the_look(reference):
    points = np.random.default_rng(0).standard_normal((900, 3))
    points *= 110 / np.linalg.norm(points, axis=1, keepdims=True)
    with pytest.raises(InputError, match="No face is found"):
        finish(find_landmarks(Mesh.from_triangles(points, ConvexHull(points).simplices), reference))


def test_a_crop_from_brows_to_lips_is_a_face(person, outside, reference):
    vertices, triangles = outside
    near = np.linalg.norm(vertices[triangles].mean(axis=1) - person[1]["sn"], axis=1) < 66
    found = finish(find_landmarks(Mesh.from_triangles(vertices, triangles[near]), reference))
    marks = [n for n in FACE if n.partition("_")[0] in ("prn", "sn", "al", "en", "ls", "sto", "ch", "n")]
    assert np.mean([np.linalg.norm(found.positions[n] - person[1][n]) for n in marks]) < 2.5
    assert {"op", "v", "t_l", "t_r", "go_l"} <= set(found.mid_air) | set(found.missing)


@pytest.mark.parametrize(
    "second, expected", [(Verdict(False, 18.0, 0.73), "second"), (Verdict(True, 30.0, 0.6), "first")]
)
@pytest.mark.parametrize("first, looks", [(Verdict(False, 53.0, 0.56), 3), (Verdict(False, 10.0, 0.8), 1)])
def test_a_place_hardly_like_a_face_is_taken_only_if_a_thorough_look_finds_no_better(
    reference, monkeypatch, first, looks, second, expected
):
    taken = []

    def trials(look, *rest):
        taken.append(look)
        yield Progress(0.5, "")
        return [(1.0, 1.0, None, None)]

    def fits(look, *rest):
        yield Progress(0.5, "")
        return [(first, 1.0, "first", None)] if look in placed_face.QUICK else [(second, 1.0, "second", None)]

    monkeypatch.setattr(looking, "_trials", trials)

    def as_it_is(reference, result, less):
        yield Progress(0.5, "")
        return result

    monkeypatch.setattr(looking, "_fits", fits)
    monkeypatch.setattr(placed_face, "_or_infant", as_it_is)
    monkeypatch.setattr(placed_face, "share_of", lambda *_: 1.0)
    scan = reference.skin
    _, fit, _, _ = finish(placed_face.place_face(scan, reference, shape_space(reference), (1.0,)))
    assert len(taken) == looks
    assert fit == (expected if looks == 3 else "first")


def test_a_thorough_look_begins_with_the_places_most_like_a_face(reference, monkeypatch):
    """A face seen from above lies worse on the scan than on the top of the head: it must be among those that are followed."""
    space = shape_space(reference)
    places = {1.0: (2.0, 0.7), 2.0: (3.2, 0.95), 3.0: (2.4, 0.6)}  # size of the pose -> misfit, likeness of its fit

    def search(*rest):
        yield Progress(0.5, "")
        return [Pose(size, np.eye(3), np.zeros(3), 0.0) for size in places]

    def fit(space, target, pose, *rest, **more):
        yield 0.5
        return pose

    def size(look, pose):
        return round(pose.scale / look.size, 6)

    for look, order in zip(placed_face.LOOKS, ([1.0, 3.0, 2.0], *([2.0, 1.0, 3.0],) * 4), strict=True):
        monkeypatch.setattr(looking, "search_poses", search)
        monkeypatch.setattr(looking, "fit_shape", fit)
        monkeypatch.setattr(looking, "misfit_of", lambda _, pose, look=look: places[size(look, pose)][0])
        monkeypatch.setattr(looking, "likeness_of", lambda _, __, pose, look=look: places[size(look, pose)][1])
        samples = reference.skin.vertices
        work = looking._trials(look, reference, space, reference.skin, samples, samples, 1.0)
        trials = sorted(finish(work), key=lambda t: t[0])
        assert list(dict.fromkeys(size(look, pose) for _, _, pose, _ in trials)) == order  # of a half, on either side


@pytest.mark.parametrize(
    ("name", "off", "parted", "scale", "by_map"),
    [
        ("pg", 4.0, True, 1.0, True),
        ("pg", 6.0, True, 1.0, False),
        ("cph_r", 6.0, True, 1.0, False),
        ("pg", 6.0, False, 1.0, True),
        ("pg", 4.0, True, 0.7, False),
        ("pg", 6.0, True, 1.3, True),
        ("prn", 6.0, True, 1.0, True),
        ("g", 4.0, False, 1.0, False),
    ],
)
def test_of_parted_lips_and_their_chin_the_range_map_is_trusted_near_the_shape(name, off, parted, scale, by_map):
    shape, other = {name: np.array([1.0, 2, 3])}, {name: np.array([1.0, 2, 3 - off])}
    assert better_of(shape, other, parted, scale)[name] is (other if by_map else shape)[name]


@pytest.mark.parametrize(("scan", "carried"), [("s1_smile_scan", False), ("s1_scan", True)])
def test_a_chin_that_the_range_map_has_far_off_stays_under_parted_lips(reference, shared, monkeypatch, scan, carried):
    shape = {}

    def weighed(seen, positions, *_):
        yield Progress(1.0, "")
        shape.update(positions)
        return positions | {"pg": positions["pg"] + 12.0}

    monkeypatch.setattr(find, "weighed", weighed)
    mesh, _ = clean_scan(read_ply(shared / "ict" / "examples" / f"{scan}.ply"))
    found = finish(find_landmarks(mesh, reference)).positions["pg"]
    assert found == pytest.approx(shape["pg"] + (12.0 if carried else 0.0), abs=1e-9)
