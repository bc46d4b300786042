# SPDX-License-Identifier: GPL-3.0-or-later
"""The muscles of the reference head: named, painted as grids, layered between skin and bone, merging where they should."""

import csv
import re

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.muscle_room import Room
from headshop.sim.anatomy.muscle_shape import frames, muscle_shape, muscle_sheet, recentred, reshaped
from headshop.sim.anatomy.storage import load_head
from headshop.sim.anatomy.tissue_depth import TABLE
from headshop.sim.health.topology import closed, volume
from headshop.sim.tissue.muscle_field import _arc

KNOT = ("zygomaticus_major", "levator_anguli_oris", "risorius", "buccinator", "depressor_anguli_oris")
MERGE = 7.0  # mm round a shared node where muscles grow into each other


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def table():
    with open(TABLE.with_name("muscles.csv"), encoding="utf-8", newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def muscles(head):
    return {m.name: m for m in head.muscles}


@pytest.fixture(scope="module")
def left(head):
    """The left and the middle muscles, all vertices of their shapes (n, 3) and the muscle (n,) each belongs to."""
    some = [m for m in head.muscles if not m.name.endswith("_r")]
    points = np.concatenate([m.shape.vertices for m in some])
    return some, points, np.repeat(np.arange(len(some)), [len(m.shape.vertices) for m in some])


def base(name):
    return name.removesuffix("_l").removesuffix("_r")


def of_whom(bad, owner, some):
    return {some[k].name: int((bad & (owner == k)).sum()) for k in np.unique(owner[bad])}


# The table


def test_at_least_28_are_named_on_both_sides(muscles, table):
    wanted = {name + s for name, r in table.items() for s in (("_l", "_r") if r["paired"] == "1" else ("",))}
    assert set(muscles) == wanted and len(table) >= 28 and sum(r["paired"] == "1" for r in table.values()) >= 28
    assert {r["kind"] for r in table.values()} == {"sheet", "linear", "sphincter"}
    needed = ("masseter", "temporalis", "platysma", "frontalis_inner", "frontalis_outer", "orbicularis_oris_upper")
    assert {*needed, "orbicularis_oris_lower", "orbicularis_oculi_orbital"} <= set(table)


def test_names_are_latin_and_every_row_has_its_sources(table):
    for name, row in table.items():
        assert re.match(r"(Musculus [a-z]+|Venter [a-z]+ musculi [a-z]+|Platysma$)", row["name_ta"]), name
        assert all(row[k] for k in ("origin", "insertion", "facs_aus", "innervation", "source", "innervation_source"))
        assert re.search(r"(III|V3|VII)\b", row["innervation"]), name
        assert row["basis"]
    assert len({row["name_ta"] for row in table.values()}) == len(table)


def test_fibres_are_the_grid_of_the_table(muscles, table):
    for name, m in muscles.items():
        row = table[base(name)]
        assert m.kind == row["kind"] and m.fibres.shape[0] == int(row["fibres"]) >= 3, name
        assert m.width == float(row["width_mm"]) and m.thickness == float(row["thickness_mm"]), name
        if m.kind != "sphincter":
            assert m.fibres.shape[1] == int(row["steps"]), name
            assert row["path"].count(">") >= 2, name  # more than a straight line
            assert len(row["depth"].split()) in (1, row["path"].count(">") + 1), name


def test_fibres_run_evenly(muscles):
    """Neighbours do not cross, and no step is a jump."""
    for m in muscles.values():
        step = np.linalg.norm(np.diff(m.fibres, axis=1), axis=2)
        assert step.min() > 0.2 and step.max() < 4 * np.median(step), m.name
        if not m.ring:
            along, side = np.gradient(m.fibres, axis=1)[:, 1:-1], np.gradient(m.fibres, axis=0)[:, 1:-1]
            turned = np.cross(along, side)
            middle = turned.mean(axis=0, keepdims=True)
            assert ((turned * middle).sum(-1) > 0).mean() > 0.79, m.name


# Where they are


def test_every_vertex_is_under_the_skin(head, left):
    """0.3 mm under what is seen of the skin, and within the flesh: not in the mouth, the nostrils or the lids' gap."""
    some, points, owner = left
    out = ~inside(points, head.skin.vertices, head.skin.triangles)
    assert not out.any(), of_whom(out, owner, some)
    seen = head.skin.triangles[~(head.groups["inner"][head.skin.triangles] > 0.5).all(axis=1)]
    shallow = Surface(head.skin.vertices, seen).closest(points).distance < 0.295
    assert not shallow.any(), of_whom(shallow, owner, some)


def test_no_vertex_is_in_bone_or_eyeball(head, left):
    some, points, owner = left
    for part in ("skull", "mandible"):
        bone = head.parts[part]
        within = inside(points, bone.vertices, bone.triangles)
        deep = np.zeros(len(points), bool)
        if within.any():
            deep[within] = Surface(bone.vertices, bone.triangles).closest(points[within]).distance > 0.3
        assert not deep.any(), (part, of_whom(deep, owner, some))
    for eye in head.eyes:
        poking = np.linalg.norm(points - eye.centre, axis=1) < eye.radius
        assert not poking.any(), of_whom(poking, owner, some)


def test_fibres_are_in_the_tissue(head, left):
    some, _, _ = left
    points = np.concatenate([m.fibres.reshape(-1, 3) for m in some])
    owner = np.repeat(np.arange(len(some)), [m.fibres.size // 3 for m in some])
    out = ~inside(points, head.skin.vertices, head.skin.triangles)
    assert not out.any(), of_whom(out, owner, some)


def test_origins_hold_to_their_bone(head):
    surfaces = {p: Surface(head.parts[p].vertices, head.parts[p].triangles) for p in ("skull", "mandible")}
    for m in head.muscles:
        for part, ends in ((m.origin, m.fibres[:, 0]), (m.insertion, m.fibres[:, -1])):
            if part in surfaces and not m.ring:
                far = (
                    13.0 if base(m.name) == "buccinator" else 4.5
                )  # most of it springs from a ligament behind the teeth
                assert np.median(surfaces[part].closest(ends).distance) < far, m.name


def test_layers_do_not_cut_each_other(left, table):
    """No muscle reaches more than 1 mm into one of another layer, but where both end in a shared node."""
    some, points, owner = left
    every = np.concatenate([np.unique(np.round(m.fibres.reshape(-1, 3), 3), axis=0) for m in some])
    nodes, count = np.unique(every, axis=0, return_counts=True)
    nodes = cKDTree(np.concatenate([nodes[count > 1], nodes[count > 1] * [-1, 1, 1]]))
    free = nodes.query(points)[0] > MERGE
    level = np.array([float(table[base(m.name)]["level"]) for m in some])
    cuts = {}
    for k, m in enumerate(some):
        low, high = m.shape.vertices.min(axis=0), m.shape.vertices.max(axis=0)
        near = free & (level[owner] != level[k]) & ((points > low) & (points < high)).all(axis=1)
        near[near] = winding_number(points[near], m.shape.vertices, m.shape.triangles) > 0.5
        if near.any():
            depth = Surface(m.shape.vertices, m.shape.triangles).closest(points[near]).distance
            for other in np.unique(owner[near][depth > 1.0]):
                cuts[some[other].name, m.name] = round(float(depth[owner[near] == other].max()), 2)
    assert not cuts, cuts


def test_sides_mirror(muscles):
    for name, m in muscles.items():
        if name.endswith("_l"):
            other = muscles[name[:-2] + "_r"]
            np.testing.assert_allclose(other.fibres * [-1, 1, 1], m.fibres, atol=1e-3)
            np.testing.assert_allclose(other.shape.vertices * [-1, 1, 1], m.shape.vertices, atol=1e-3)
        elif not name.endswith("_r"):
            assert cKDTree(m.shape.vertices).query(m.shape.vertices * [-1, 1, 1])[0].max() < 1e-3


# Where they merge


def shared(a, b):
    """How many end points of ``a`` are points of ``b``, exactly."""
    far = cKDTree(b.fibres.reshape(-1, 3)).query(a.fibres[:, -1])[0]
    return int((far < 1e-6).sum())


def test_muscles_of_the_mouth_corner_share_the_modiolus(head, muscles):
    lips = [muscles[f"orbicularis_oris_{k}"] for k in ("upper", "lower")]
    nodes = np.unique(np.round(np.concatenate([m.fibres[:, -1] for m in lips]), 6), axis=0)
    assert 3 <= len(nodes) <= 6 and np.ptp(nodes, axis=0).max() < 12
    tree = cKDTree(nodes)
    for name in KNOT:
        assert tree.query(muscles[name + "_l"].fibres[:, -1])[0].max() < 1e-5, name
    corner = head.landmark_positions()["ch_l"]
    assert np.linalg.norm(nodes.mean(axis=0) - corner) < 15 and nodes[0, 0] > corner[0]


def test_levators_and_depressors_grow_into_the_lips(muscles):
    upper, lower = muscles["orbicularis_oris_upper"], muscles["orbicularis_oris_lower"]
    for name in ("levator_labii_superioris", "zygomaticus_minor", "levator_labii_alaeque_nasi"):
        assert shared(muscles[name + "_l"], upper) >= 2, name
    assert shared(muscles["depressor_labii_inferioris_l"], lower) >= 3


def test_muscles_of_the_brow_share_their_ends(muscles):
    frontal = [muscles[f"frontalis_{k}_l"] for k in ("inner", "major", "outer")]
    assert np.array_equal(frontal[0].fibres[-1, -1], frontal[1].fibres[0, -1])
    assert np.array_equal(frontal[1].fibres[-1, -1], frontal[2].fibres[0, -1])
    assert shared(muscles["procerus"], frontal[0]) >= 2
    assert shared(muscles["corrugator_l"], frontal[1]) >= 2
    assert shared(muscles["depressor_supercilii_l"], frontal[0]) >= 2


def test_lids_and_orbit_share_a_ring(muscles):
    orbital, palpebral = (muscles[f"orbicularis_oculi_{k}_l"].fibres for k in ("orbital", "palpebral"))
    assert np.linalg.norm(orbital[-1] - palpebral[0], axis=1).max() < 0.7


# How they pull


def test_muscles_run_the_right_way(muscles):
    """A surgeon's glance: each of these pulls its insertion toward its origin."""
    pull = {name: (m.fibres[:, 0] - m.fibres[:, -1]).mean(axis=0) for name, m in muscles.items()}
    assert pull["zygomaticus_major_l"][2] > 20 and pull["zygomaticus_major_l"][0] > 8
    assert pull["depressor_anguli_oris_l"][2] < -12
    assert pull["risorius_l"][0] > 12 and abs(pull["risorius_l"][2]) < 20
    assert pull["frontalis_inner_l"][2] > 25 and abs(pull["frontalis_inner_l"][0]) < 12
    assert pull["corrugator_l"][0] < -12 and abs(pull["corrugator_l"][2]) < 14
    assert pull["procerus"][2] < -20
    assert pull["levator_labii_superioris_l"][2] > 20
    assert pull["depressor_labii_inferioris_l"][2] < -8
    assert pull["mentalis_l"][2] > 5
    assert pull["masseter_l"][2] > 30 and pull["masseter_l"][1] < 0
    assert pull["temporalis_l"][2] > 30
    assert pull["platysma_l"][2] < -60


def test_sphincters_surround(muscles):
    for m in muscles.values():
        if m.ring:
            assert m.kind == "sphincter" and m.centre is not None
            ring = m.fibres.mean(axis=0) - m.centre
            turns = np.unwrap(np.append(a := np.arctan2(ring[:, 2], ring[:, 0]), a[0]))
            assert abs(abs(turns[-1] - turns[0]) - 2 * np.pi) < 0.1, m.name


def test_a_lip_pulls_to_where_its_centre_is_moved(muscles):
    muscle = muscles["orbicularis_oris_upper"]
    points = muscle.fibres[2, 2:-2] + [0.0, -2.0, 0.0]
    normals = np.tile([0.0, -1.0, 0.0], (len(points), 1))
    before = _arc(muscle, points, normals)[1]
    assert before[:3, 0].min() > 0 > before[-3:, 0].max()  # from either side to the middle
    moved = recentred(muscle, muscle.centre + [12.0, 0.0, 0.0])
    after = _arc(moved, points, normals)[1]
    assert (after[:, 0] >= before[:, 0] - 1e-9).all() and after[len(points) // 2, 0] > 0.2
    np.testing.assert_array_equal(moved.fibres, muscle.fibres)
    with pytest.raises(ValueError, match="sphincter"):
        recentred(muscles["procerus"], [0, 0, 0])


# What they look like


def test_bellies_are_smooth(muscles):
    """Going from station to station a belly seldom turns by more than 60 degrees: no shards, no jagged edges."""
    for m in muscles.values():
        rings = m.shape.vertices.reshape(-1, 4 * len(m.fibres) - 4, 3)
        step = np.diff(np.concatenate([rings, rings[:2]]) if m.ring else rings, axis=0)
        step /= np.maximum(np.linalg.norm(step, axis=2, keepdims=True), 1e-9)
        assert ((step[1:] * step[:-1]).sum(-1) < 0.5).mean() < 0.1, m.name


def test_bellies_are_closed(muscles):
    for m in muscles.values():
        assert closed(m.shape) and volume(m.shape) > 0, m.name


def test_masseter_and_temporalis_are_thick_and_platysma_is_broad(muscles):
    assert volume(muscles["masseter_l"].shape) > 6000 and volume(muscles["temporalis_l"].shape) > 12000
    sheet = muscles["platysma_l"].fibres
    across = np.linalg.norm(np.diff(sheet, axis=0), axis=2).sum(axis=0)
    assert across.max() > 50 and np.ptp(sheet[..., 2]) > 100
    frontal = np.ptp([muscles[f"frontalis_{k}_l"].fibres[..., 0].max() for k in ("inner", "outer")])
    assert frontal > 20


def test_bellies_follow_a_warp(muscles, head):
    muscle = muscles["zygomaticus_major_l"]
    moved = reshaped(muscle, muscle.fibres + [5.0, 0, 0])
    assert np.array_equal(moved.shape.faces, muscle.shape.faces)
    np.testing.assert_allclose(moved.shape.vertices, muscle.shape.vertices + [5.0, 0, 0], atol=1e-6)
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(
        reshaped(muscle, muscle.fibres @ turn.T).shape.vertices, muscle.shape.vertices @ turn.T, atol=1e-6
    )
    larger = reshaped(muscle, 1.44 * muscle.fibres)
    assert larger.thickness == pytest.approx(1.2 * muscle.thickness)


def test_belly_swells_and_tapers():
    t = np.linspace(0, 40, 12)
    fibres = np.stack([np.stack([t, np.full(12, y), 0 * t], axis=1) for y in (-3.0, 0.0, 3.0)])
    mesh = muscle_shape(fibres, width=6, thickness=4)
    assert closed(mesh) and volume(mesh) > 0
    z = np.abs(mesh.vertices[:, 2])
    middle = np.abs(mesh.vertices[:, 0] - 20) < 4
    ends = mesh.vertices[:, 0] < 1
    assert 1.5 < z[middle].max() <= 2.01 and z[ends].max() < 0.6
    edge = np.abs(mesh.vertices[:, 1]) > 2.9
    assert z[edge].max() < 1e-9  # rounded off to nothing at the sides


def test_sheets_have_square_frames():
    t = np.linspace(0, 3, 9)
    fibres = np.stack([np.stack([10 * np.cos(t), 10 * np.sin(t), np.full(9, z)], axis=1) for z in (0.0, 2.0, 4.0)])
    sheet = muscle_sheet(fibres)
    assert sheet.shape == (5, 17, 3)
    np.testing.assert_allclose(sheet[::2, ::2], fibres)
    along, side, normal = frames(sheet)
    for a, b in ((along, side), (along, normal), (side, normal)):
        assert np.abs((a * b).sum(-1)).max() < 1e-9
    assert np.abs(np.linalg.norm(sheet[..., :2], axis=-1)[:, 3:-3] - 10).max() < 0.05  # midway on the circle, too


def test_belly_stays_in_its_room(head, muscles):
    fibres = muscles["frontalis_inner_l"].fibres
    room = Room(head.skin, [head.parts["skull"]])
    free, bounded = muscle_shape(fibres, 8, 14), muscle_shape(fibres, 8, 14, room=room)
    poking = [(~inside(m.vertices, head.skin.vertices, head.skin.triangles)).sum() for m in (free, bounded)]
    assert poking[0] > 10 and poking[1] == 0
