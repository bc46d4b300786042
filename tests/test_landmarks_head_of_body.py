# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans of somebody from head to foot, or among walls: the head is found in them, in any unit, and built."""

from types import SimpleNamespace

import numpy as np
import pytest

from headshop.headshop_addon import pipeline
from headshop.sim.adapt.scan_surface import near_head
from headshop.sim.errors import InputError
from headshop.sim.landmarks import head_of_body, placed_face
from headshop.sim.landmarks.find import FoundLandmarks, find_landmarks
from headshop.sim.landmarks.head_of_body import (
    APART,
    ENDS,
    FEW,
    HEAD,
    around,
    body_scales,
    ends,
    other_scales,
    parts_of,
)
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.verdict import Verdict
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.ply import write_ply
from headshop.sim.scan.units import USUAL, plausible_units

#: Middle, from the chin, and half the size, mm, of what a body is made of.
BODY = [((0, 20, -330), (190, 115, 260)), ((0, 20, -600), (170, 120, 170))] + [
    ((side * x, y, z), size)
    for side in (-1, 1)
    for (x, y, z), size in (
        ((95, 20, -880), (85, 90, 260)),
        ((95, 30, -1250), (60, 62, 240)),
        ((95, -20, -1490), (48, 130, 35)),
        ((260, 30, -330), (52, 55, 190)),
        ((300, 10, -620), (42, 45, 170)),
        ((310, -5, -830), (25, 45, 95)),
    )
]


def blob(middle, size, n=30):
    """An ellipsoid, a little bumpy: vertices and triangles."""
    polar, way = np.meshgrid(np.linspace(0, np.pi, n), np.linspace(0, 2 * np.pi, 2 * n, endpoint=False), indexing="ij")
    points = (
        np.stack([np.sin(polar) * np.cos(way), np.sin(polar) * np.sin(way), np.cos(polar)], axis=-1) * size + middle
    )
    points = (points + 2 * np.sin(points[..., [1, 2, 0]] / 19)).reshape(-1, 3)
    row, column = np.arange(n - 1)[:, None] * 2 * n, np.arange(2 * n)[None]
    a, b = row + column, row + (column + 1) % (2 * n)
    sides = [np.stack([a, a + 2 * n, b], axis=-1), np.stack([b, a + 2 * n, b + 2 * n], axis=-1)]
    return points, np.concatenate(sides).reshape(-1, 3)


def wall(corner, along, up, step=25.0, rough=4.0):
    """A rough wall from its ``corner``: vertices and triangles."""
    along, up = np.array(along, float), np.array(up, float)
    m, n = (int(np.linalg.norm(side) / step) for side in (along, up))
    a, b = np.meshgrid(np.linspace(0, 1, m), np.linspace(0, 1, n), indexing="ij")
    out = np.cross(along, up) / np.linalg.norm(np.cross(along, up))
    points = corner + a[..., None] * along + b[..., None] * up
    points = points + np.random.default_rng(m).normal(0, rough, (m, n, 1)) * out
    index = np.arange(m * n).reshape(m, n)
    one, two, three, four = index[:-1, :-1], index[1:, :-1], index[:-1, 1:], index[1:, 1:]
    sides = [np.stack([one, two, three], axis=-1), np.stack([two, four, three], axis=-1)]
    return points.reshape(-1, 3), np.concatenate(sides).reshape(-1, 3)


@pytest.fixture(scope="module")
def body(reference):
    """The reference's head on a body, 1.75 m high, from its scanned side: a mesh in mm."""
    skin, marks = reference.skin, reference.landmark_positions()
    outer = reference.groups["inner"] < 0.5
    parts = [(skin.vertices, skin.triangles[outer[skin.triangles].all(axis=1)])]
    parts += [blob(marks["gn"] + [0, 60, 0] + middle, size) for middle, size in BODY]
    start = np.cumsum([0] + [len(points) for points, _ in parts])
    triangles = np.concatenate([t + s for (_, t), s in zip(parts, start, strict=False)])
    return Mesh.from_triangles(np.concatenate([points for points, _ in parts]), triangles)


def turned(mesh, seed, scale):
    """``mesh`` in any turn, in a unit of 1 / ``scale`` mm, and the turn (3, 3)."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return mesh.moved(mesh.vertices @ turn.T * scale), turn


@pytest.mark.parametrize("unit", [1000.0, 10.0])  # read as metres; not read as centimetres, in which busts are larger
def test_the_head_of_a_body_is_found(reference, body, unit):
    scan, turn = turned(body, int(unit), 1 / unit)
    units = plausible_units(scan)
    assert list(units) == (["m"] if unit == 1000 else ["mm"])
    found = finish(find_landmarks(scan, reference, list(units.values()), any_size=True))
    assert found.unit_scale == unit
    marks = reference.landmark_positions()
    for name in ("prn", "en_l", "en_r", "ch_l", "ch_r", "gn"):
        assert np.linalg.norm(found.positions[name] - turn @ marks[name]) < 5.0, name


def test_what_is_as_large_as_a_bust_is_looked_at_as_a_whole(reference, monkeypatch):
    def never(*_):
        raise AssertionError("parts of a head are looked at")

    monkeypatch.setattr(head_of_body, "looked", never)
    assert finish(head_of_body.head_of_body(reference.skin, reference, None, None, [1.0])) is None


def test_an_end_without_a_plain_face_is_passed_over(reference, body, monkeypatch):
    """The first end shows half a face, the second one whole ones, of which the better is taken."""
    seen, space = [], SimpleNamespace(face=np.ones(1))
    fit, worse = (SimpleNamespace(points=np.full((1, 3), place)) for place in (0.0, -200.0))

    def looked(look, part, *_):
        seen.append(part)
        yield Progress(0.5, "")
        return [
            (Verdict(False, bad, 0.9), 1.0, of, None, space) for bad, of in ((2.0, worse), (1.0, fit), (3.0, worse))
        ]

    monkeypatch.setattr(head_of_body, "looked", looked)
    monkeypatch.setattr(head_of_body, "share_of", lambda *_: 0.5 if len(seen) == 1 else 0.9)
    best, part = finish(head_of_body.head_of_body(body, reference, None, None, [0.001, 1.0]))
    assert len(seen) == 2 and best[2] is fit
    far = np.linalg.norm(part.vertices, axis=1)
    head = np.linalg.norm(reference.skin.vertices[reference.groups["inner"] < 0.5], axis=1)
    assert far.max() < HEAD and (far > 150).sum() > 0.9 * ((head > 150) & (head < HEAD)).sum()  # all of the head there


def test_a_bust_in_no_unit_is_none_but_as_bulky(reference, body, in_a_room):
    """Looked at from its ends as somebody of two metres, it took three times as long."""
    operator, quads = smoother(reference.skin.faces, len(reference.skin.vertices), 1)
    head = Mesh(
        operator @ reference.skin.vertices, quads
    )  # no side of its triangles is 15 cm long at this size, as of walls
    size = np.ptp(head.vertices, axis=0).max()
    for metres in (1.2, 2.0, 2.5):
        large = head.moved(head.vertices * metres / size)
        assert head_of_body.may_be_bust(large, [1000.0])
        assert not head_of_body.is_bust(large, 1000.0) and head_of_body.is_bust(large, size / metres)
    assert not head_of_body.may_be_bust(head, [1.0])  # a head it is
    assert not head_of_body.may_be_bust(head.moved(head.vertices * 8), [1.0, 0.1])  # in one of these units
    assert not head_of_body.may_be_bust(head, [])
    assert not head_of_body.may_be_bust(body, [1.0])
    assert not head_of_body.may_be_bust(in_a_room[0], [1.0])


def test_a_bust_in_no_unit_is_not_looked_at_as_a_body(reference, monkeypatch):
    """It is seen in any size, at which it is no larger than a bust, and then in that."""
    asked = []

    def sized(mesh, reference, space, template, unit_scales, or_infant):
        asked.append("any size")
        yield Progress(0.5, "")
        return answers[0], []

    def of_body(mesh, reference, space, template, scales):
        asked.append(list(scales))
        yield Progress(0.5, "")
        raise InputError("enough")

    monkeypatch.setattr(placed_face, "face_of_any_size", sized)
    monkeypatch.setattr(placed_face, "head_of_body", of_body)
    head = reference.skin
    large = head.moved(head.vertices * 2 / np.ptp(head.vertices, axis=0).max())
    for answers in ((150.0, 150.0), (900.0, 1000.0), (None, 1000.0)):
        asked.clear()
        with pytest.raises(InputError, match="enough"):
            finish(placed_face.place_face(large, reference, shape_space(reference), [1000.0], any_size=True))
        assert asked == ["any size", [answers[1]]]
    asked.clear()
    with pytest.raises(InputError, match="enough"):
        finish(placed_face.place_face(large, reference, shape_space(reference), [1000.0]))  # somebody said so
    assert asked == [[1000.0]]


def test_ends_are_what_sticks_out(body):
    found = ends(body.vertices)
    assert 4 <= len(found) <= ENDS
    apart = np.linalg.norm(found[:, None] - found, axis=2)[~np.eye(len(found), dtype=bool)]
    assert apart.min() >= APART
    top, sole = body.vertices[:, 2].max(), body.vertices[:, 2].min()
    assert {top, sole} == {v for v in (top, sole) if np.abs(found[:2, 2] - v).min() < 60}
    dense = np.concatenate([body.vertices, np.repeat(body.vertices[body.vertices[:, 2] > top - 250], 20, axis=0)])
    assert len(ends(dense)) == len(found)  # where there are most points is as far away
    assert np.abs(ends(dense)[:2, 2] - top).min() < 60


def test_what_is_bulky_is_no_body(body):
    assert body_scales(body) == [1.0]
    assert other_scales(body, [1.0]) == pytest.approx([1100 / np.ptp(body.vertices[:, 2])])  # it may end at the hips
    assert body_scales(body.moved(body.vertices / 10)) == [10.0]
    bulky = Mesh.from_triangles(*blob((0, 0, 0), (700, 700, 700)))
    assert body_scales(bulky) == [] and other_scales(bulky, [], [1.0]) == []


@pytest.fixture(scope="module")
def in_a_room(body):
    """The body in the corner of a room, a board beside it, and how many triangles it has itself."""
    low = body.vertices.min(axis=0) - [900, 600, 0]
    parts = [
        (body.vertices, body.triangles),
        wall(low, (2600, 0, 0), (0, 1600, 0)),
        wall(low, (0, 1600, 0), (0, 0, 2300)),
    ]
    parts += [
        wall(low + [2300, 300, 900], (0, 600, 0), (200, 0, 0), 8),
        blob(low + [300, 300, 400], (130.0, 150.0, 140.0)),
    ]
    start = np.cumsum([0] + [len(points) for points, _ in parts])
    triangles = np.concatenate([t + s for (_, t), s in zip(parts, start, strict=False)])
    return Mesh.from_triangles(np.concatenate([points for points, _ in parts]), triangles), len(body.triangles)


def test_the_head_of_somebody_in_a_room_is_found(reference, in_a_room):
    scan, turn = turned(in_a_room[0], 5, 1 / 1000)
    found = finish(find_landmarks(scan, reference, [1000.0], any_size=True))
    assert found.unit_scale == 1000.0
    marks = reference.landmark_positions()
    for name in ("prn", "en_l", "en_r", "ch_l", "ch_r", "gn"):
        assert np.linalg.norm(found.positions[name] - turn @ marks[name]) < 5.0, name


def test_the_head_of_a_body_in_no_unit_is_as_large_as_most(reference, body, monkeypatch):
    """It is looked at as a body that is 1.75 m high, and brought to the size of most from there."""
    scan = body.moved(body.vertices * 0.0021)
    tall, short = (stature / np.ptp(scan.vertices[:, 2]) for stature in (1750, 1100))
    assert other_scales(scan, [1000.0]) == pytest.approx([tall, short])
    assert other_scales(scan, [1000.0, tall / 1.1]) == pytest.approx([short])  # that is as good
    monkeypatch.setattr(placed_face, "resized", lambda _, result, factor: (*result[:1], factor, *result[2:]))
    monkeypatch.setattr(placed_face, "of_most", lambda result: 2.0 * result[1])
    monkeypatch.setattr(placed_face, "facing_out", lambda *_: None)
    monkeypatch.setattr(placed_face, "lies", lambda *_: None)
    for other, taken in ((Verdict(False, 0.5, 0.9), "again"), (Verdict(False, 3.0, 0.9), "seen"), (None, "seen")):

        def begun(poses, _, scale, *more, other=other):
            yield Progress(0.5, "")
            return other and (other, scale, "again", None, None)

        monkeypatch.setattr(placed_face, "_begun_from", begun)
        for scale, own in ((470.0, 2.0), (1000.0, 1000.0)):
            seen = (Verdict(False, 1.0, 0.9), scale, "seen", None, None)
            assert finish(placed_face._placed_on((seen, reference.skin), reference, USUAL))[:2] == (own, taken)


def test_a_room_is_looked_at_piece_by_piece(body, in_a_room):
    """What is as large as a head or a bust is looked at whole, of what is larger its ends; walls are not."""
    scan, own = in_a_room
    assert 1.0 in other_scales(scan, [])
    assert 1.0 not in other_scales(scan, [1.0])
    parts = parts_of(scan, 1.0)
    assert all(len(part.faces) >= FEW for _, part in parts)
    assert (
        sum(len(part.faces) == len(piece.faces) for piece, part in parts) >= 3
    )  # blobs, and the head, all in one piece
    assert all(90 < np.ptp(part.vertices, axis=0).max() < 900 for _, part in parts)
    assert max(len(piece.faces) for piece, _ in parts) < own + 8000  # a blob and a shelf, but no wall


def test_the_ends_of_two_people_are_looked_at_in_turn(body):
    """And what is smaller than a face is not, nor a shred."""
    bodies = [blob((x, 0, 0), (150.0, 100.0, 850.0)) for x in (0, 900)]
    parts = [*bodies, blob((450.0, 300, 0), (30.0, 30.0, 30.0)), blob((450.0, 400, 0), (60.0, 4.0, 4.0))]
    parts.append(wall((-500.0, 600, -900), (2000, 0, 0), (0, 0, 1800)))
    start = np.cumsum([0] + [len(points) for points, _ in parts])
    triangles = np.concatenate([t + s for (_, t), s in zip(parts, start, strict=False)])
    scan = Mesh.from_triangles(np.concatenate([points for points, _ in parts]), triangles)
    of_one = len(bodies[0][1])
    seen = [part.vertices.mean(axis=0) for piece, part in parts_of(scan, 1.0) if len(piece.faces) <= of_one]
    second = [place[0] > 450 for place in seen]
    assert len(seen) > 3 and all(one != other for one, other in zip(second[:-1], second[1:], strict=True))
    assert all(abs(place[1]) < 100 for place in seen)


def test_a_head_in_shreds_before_a_wall_is_looked_at_as_a_whole_too(reference):
    skin, low = reference.skin, reference.skin.vertices.min(axis=0)
    triangles, middle = skin.triangles, skin.vertices[skin.triangles].mean(axis=1)
    halves = [triangles[middle[:, 0] < -1], triangles[middle[:, 0] > 1] + len(skin.vertices)]
    behind, more = wall(low + [-400, 500, -300], (1100, 0, 0), (0, 0, 1000))
    points = np.concatenate([skin.vertices, skin.vertices, behind])
    scan = Mesh.from_triangles(points, np.concatenate([*halves, more + 2 * len(skin.vertices)]))
    parts = parts_of(scan, 1.0)
    assert max(len(part.faces) for _, part in parts) >= len(halves[0]) + len(halves[1]) - 50


def test_a_speck_is_no_end(body):
    far = body.vertices.max(axis=0) + 600
    speck = Mesh.from_triangles([*body.vertices, far, far + [9, 0, 0], far + [0, 9, 0]], body.triangles)
    corner = len(body.vertices)
    speck = Mesh.from_triangles(speck.vertices, [*body.triangles, (corner, corner + 1, corner + 2)])
    assert np.linalg.norm(ends(head_of_body.surface_samples(speck)) - far, axis=1).min() < 50
    assert parts_of(speck, 1.0) and all(part.vertices.max() < far.max() - 1 for _, part in parts_of(speck, 1.0))


def test_a_body_without_walls_is_looked_at_by_its_ends():
    """Of what lies around it, as the edges of a board below, nothing is as large; if it is in shreds itself, all are ends."""
    points, triangles = blob((0, 0, 0), (150.0, 100.0, 850.0), 40)
    one = Mesh.from_triangles(points, triangles)
    parts = parts_of(one, 1.0)
    assert len(parts) == len(ends(head_of_body.surface_samples(one))) > 3
    assert all(len(piece.faces) == len(one.faces) for piece, _ in parts)
    other, more = blob((700.0, 0, -840), (100.0, 4.0, 4.0))
    both = Mesh.from_triangles(np.concatenate([points, other]), np.concatenate([triangles, more + len(points)]))
    first, second = parts_of(both, 1.0)[:2]
    assert len(first[0].faces) == len(one.faces) and len(second[0].faces) == len(both.faces)
    low, high = (
        Mesh.from_triangles(points, triangles[(points[triangles, 2] * side > 60).all(axis=1)]) for side in (-1, 1)
    )
    torn = Mesh.from_triangles(
        np.concatenate([low.vertices, high.vertices]), [*low.triangles, *high.triangles + len(points)]
    )
    assert {len(piece.faces) for piece, _ in parts_of(torn, 1.0)} == {len(low.faces), len(high.faces), len(torn.faces)}


def test_a_part_is_all_within_reach(body):
    part = around(body, body.vertices[0], 200.0)
    assert 0 < len(part.faces) < len(body.faces)
    assert np.linalg.norm(part.vertices - body.vertices[0], axis=1).max() < 200.0


def test_a_skin_is_laid_on_the_head_of_a_body_alone(reference, body):
    marks = reference.landmark_positions()
    given = {name: marks[name] for name in ("prn", "en_l", "en_r", "ch_l", "ch_r", "gn")}
    near = near_head(reference, body, given)
    assert np.ptp(near.vertices, axis=0).max() < 900
    assert len(near.triangles) < 0.8 * len(body.faces)
    elsewhere = {name: place + [0, 3000, 0] for name, place in given.items()}
    assert len(near_head(reference, body, elsewhere).triangles) > 0.95 * len(body.faces)  # all but those without area
    speck, _ = blob(elsewhere["prn"], (5.0, 5.0, 5.0), 4)
    more = np.concatenate([body.triangles, len(body.vertices) + np.arange(9).reshape(3, 3)])
    more = Mesh.from_triangles(np.concatenate([body.vertices, speck]), more)
    assert len(near_head(reference, more, elsewhere).triangles) > 0.95 * len(body.faces)  # three triangles are no head


def test_the_unit_of_a_body_has_its_name(body, monkeypatch, tmp_path):
    path = tmp_path / "body.ply"
    scan = body.moved(body.vertices / 10)
    write_ply(path, scan)

    def found(mesh, **_):
        yield Progress(0.5, "")
        places = ((0, -100, 0), (15, -70, 40), (-15, -70, 40), (25, -75, -35), (-25, -75, -35))
        marks = dict(zip(("prn", "en_l", "en_r", "ch_l", "ch_r"), np.array(places, dtype=float), strict=True))
        return FoundLandmarks(marks, dict.fromkeys(marks, 1.0), (), (), 10.0)

    monkeypatch.setattr(pipeline, "find_landmarks", found)
    scan, _ = finish(pipeline.load_scan_alone(path))
    assert scan.report["unit"] == "cm" and scan.report["unit_scale"] == 10.0


def test_rooms_and_odd_bodies_are_looked_at_when_no_face_is_seen_in_any_size(reference, body, monkeypatch):
    asked, space = [], SimpleNamespace()

    def nothing(*_):
        yield Progress(0.5, "")
        return []

    def of_body(mesh, reference, space, template, scales):
        asked.append(list(scales))
        yield Progress(0.5, "")
        return "a head" if len(asked) == 3 else None

    def sized(*_):
        yield Progress(0.5, "")
        return None, []

    def placed(head, reference, usual):
        yield Progress(0.5, "")
        return head, usual

    monkeypatch.setattr(placed_face, "looked", nothing)
    monkeypatch.setattr(placed_face, "face_of_any_size", sized)
    monkeypatch.setattr(placed_face, "head_of_body", of_body)
    monkeypatch.setattr(placed_face, "_placed_on", placed)
    usual = (0.5, 1.0, 40.0)
    head = finish(placed_face.place_face(body, reference, space, [1.0], any_size=True, usual=usual))
    assert head == ("a head", [1.0, *usual])
    assert asked == [[1.0], [], other_scales(body, [1.0], usual)] and len(asked[2]) == 1
