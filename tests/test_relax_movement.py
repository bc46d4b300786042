# SPDX-License-Identifier: GPL-3.0-or-later
"""How people's skin moves: the table of what was measured, the skin between, and smiles that go by it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.assets.generators.make_expression_responses import share_of
from headshop.sim.acting.expressions import expressions
from headshop.sim.adapt.rest import rest_of
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.relax import relaxed as relaxing
from headshop.sim.relax.movement import (
    BY_LIPS,
    BY_MUSCLE,
    HALF,
    RAISED,
    UNITS,
    measured,
    of_left,
    read_movement,
    with_measured,
)
from headshop.sim.relax.responses import responses
from headshop.sim.scan.individual import draw_field

SEEDS = (3, 4, 5)


@pytest.fixture(scope="module")
def known(reference):
    return measured(reference, reference.skin.vertices + responses().jaw_at(0.5))


def at_mark(reference, field, name):
    return (
        reference.landmarks.on({"skin": reference.skin.vertices + field})[name] - reference.landmark_positions()[name]
    )


def test_the_points_of_the_table_lie_on_the_skin(reference):
    points, moves = read_movement()
    on = drawn(reference.skin.faces, reference.skin.vertices)
    assert cKDTree(on).query(points)[0].max() < 0.2 and points[:, 0].min() >= 0
    assert set(moves) == set(UNITS) and all(way.shape == points.shape for way in moves.values())


def test_between_the_points_skin_goes_as_they_do(reference, known):
    points, moves = read_movement()
    rim = reference.skin.vertices[rest_of(reference).lip_rim]
    far = cKDTree(rim).query(points)[0] > 6
    vertices = drawn(reference.skin.faces, reference.skin.vertices)
    for unit in UNITS:
        field = known[unit][cKDTree(vertices).query(points[far])[1]]
        assert np.abs(field - moves[unit][far]).max() < 1.0 + 0.03 * np.abs(moves[unit]).max(), unit


def test_both_sides_move_alike_and_lips_apart(reference, known):
    vertices = reference.skin.vertices
    mirror = cKDTree(vertices).query(vertices * [-1, 1, 1])[1]
    seen = ~rest_of(reference).inner
    for unit in UNITS:
        assert np.abs(known[unit][mirror] * [-1, 1, 1] - known[unit])[seen].max() < 0.6, unit
    lips = {name: at_mark(reference, known["AU27"], name)[2] for name in ("ls", "li", "gn")}
    assert lips["li"] < -20 and lips["gn"] < -20 and abs(lips["ls"]) < 3, lips


def test_half_of_it_is_known_and_fades_inward(reference, known):
    rest = rest_of(reference)
    simulated = np.zeros_like(reference.skin.vertices)
    out = with_measured(reference, simulated, known["AU12"])
    seen = ~rest.inner
    np.testing.assert_allclose(out[seen], HALF * known["AU12"][seen])
    size = np.linalg.norm(out, axis=1)
    mouth = rest.organs["mouth"]
    first, deep = (size[mouth[rest.behind[mouth] == k]] for k in (1, 6))
    assert first.mean() > 1.0 and deep.mean() < 0.5 * first.mean()
    left = of_left(reference, known["AU6"])
    side = reference.skin.vertices[:, 0]
    assert not left[side < -15].any() and np.array_equal(left[side > 15], known["AU6"][side > 15])


def test_cheeks_rise_as_far_as_was_measured_elsewhere(reference, known):
    """Freytag et al. 2022: the skin of the medial midface rises by 6.7 +- 2.4 mm in a smile, in 21 people."""
    at, marks = reference.skin.vertices, reference.landmark_positions()
    medial = (reference.groups["cheek_l"] > 0.5) & (at[:, 0] < marks["ex_l"][0])
    medial &= (at[:, 2] < marks["or_l"][2]) & (at[:, 2] > marks["ch_l"][2])
    smile = known["AU12"] + RAISED * known["AU6"]
    assert smile[medial, 2].mean() == pytest.approx(6.7, abs=2.4)


def test_a_smile_draws_the_corners_aside_and_back(reference):
    table, joy = responses(), expressions()["joy"].muscles
    ours = sum(joy.get(name, 0.0) * field for name, field in zip(table.names, table.fields, strict=True))
    without, corner = (at_mark(reference, field, "ch_l") for field in (ours, ours + table.smile))
    assert corner[0] > without[0] + 1 and corner[1] > without[1] + 2 and 0.35 < corner[0] / corner[2] < 1.2


def test_what_people_do_beyond_our_muscles_is_taken_away(reference, monkeypatch):
    """Smiles of the table come out nearer to the person than if the strength of a smile moved nothing."""
    table, joy = responses(), expressions()["joy"].muscles
    smile = table.jaw_at(0.15) + table.smile
    smile = smile + sum(joy.get(name, 0.0) * field for name, field in zip(table.names, table.fields, strict=True))
    start, marks = reference.skin.vertices, reference.landmark_positions()
    seen = (reference.groups["face"] > 0.5) & (np.linalg.norm(start - marks["sto"], axis=1) > 30)
    off = {}
    for way, other in (("heeded", table), ("not", replace(table, smile=np.zeros_like(table.smile)))):
        monkeypatch.setattr(relaxing, "responses", lambda other=other: other)
        off[way] = []
        for seed in SEEDS:
            neutral = start + draw_field(marks, np.random.default_rng(seed))(start)
            result = relaxing.relaxed(reference, neutral + smile, np.ones(len(start)))
            off[way].append(np.linalg.norm(result.skin - neutral, axis=1)[seen].mean())
    assert np.mean(off["heeded"]) < 0.8 * np.mean(off["not"]), off


def test_the_table_comes_out_of_its_generator(shared):
    if not (shared / "ict" / "facs_fields_skin.npz").is_file():
        pytest.skip(f"no fields of action units in {shared}")
    from headshop.assets.generators.skin_movement import movement

    points, moves = movement(shared)
    at, table = read_movement()
    np.testing.assert_allclose(points, at, atol=0.06)
    for k, unit in enumerate(UNITS):
        np.testing.assert_allclose(moves[:, k], table[unit], atol=0.02, err_msg=unit)


def test_muscles_move_skin_as_their_units_were_seen_to(reference):
    table = responses()
    vertices = reference.skin.vertices
    known = measured(reference, vertices + table.jaw_at(0.5))
    seen = ~rest_of(reference).inner & (vertices[:, 0] > 15)
    for name, unit in BY_MUSCLE.items():
        field, seen_to = table.fields[table.names.index(f"{name}_l")][seen].ravel(), known[unit][seen].ravel()
        assert field @ seen_to > 0.83 * np.linalg.norm(field) * np.linalg.norm(seen_to), (
            name
        )  # the simulation's: .61 to .88
    for unit, (upper, lower) in BY_LIPS.items():
        sides = [[k for k, name in enumerate(table.names) if name.startswith(lip)] for lip in (upper, lower)]
        fields = [table.fields[of].sum(axis=0) for of in sides]
        lips = [{mark: np.linalg.norm(at_mark(reference, field, mark)) for mark in ("ls", "li")} for field in fields]
        assert lips[0]["ls"] > 1.5 * lips[0]["li"] and lips[1]["li"] > 1.5 * lips[1]["ls"], unit
        both = sum(fields)
        assert at_mark(reference, both, "ls")[1] < -1 and at_mark(reference, both, "ch_l")[0] < -1, (
            unit
        )  # forward, inward


def test_two_muscles_share_what_was_seen_as_far_as_each_reaches():
    fields = np.zeros((2, 3, 3))
    fields[0, 0] = fields[1, 1] = fields[:, 2] = [3.0, 4.0, 0.0]
    share = share_of(*fields)
    assert share[0] > 0.99 and share[1] < 0.01 and share[2] == pytest.approx(0.5)
    np.testing.assert_allclose(share + share_of(*fields[::-1]), 1)
