# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips of a mouth that stands a little open: closed they are still the person's own."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.rest import rest_of
from headshop.sim.mesh_subdivision import drawn, smoother
from headshop.sim.relax.close_lips import lips_closed, lips_rounded
from headshop.sim.relax.parted import LITTLE, TOLD, parted_lips
from headshop.sim.relax.relaxed import relaxed
from headshop.sim.relax.responses import responses

PLACED = Rotation.from_euler("xyz", (20, -35, 50), degrees=True).as_matrix() * 1.1  # of a head that lies otherwise
FEW = ("prn", "t_l", "t_r", "al_l", "al_r", "ch_l", "ch_r")


def marks_on(reference, cage):
    return reference.landmarks.on({"skin": drawn(reference.skin.faces, cage)})


def lips_forward(reference, upper, lower):
    """(n, 3) mm, somebody whose lips stand so far forward of the reference's, red and all."""
    start, marks = reference.skin.vertices, reference.landmark_positions()
    out = np.zeros(len(start))
    for name, forward in (("ls", upper), ("li", lower)):
        off = (start - (marks[name] + marks["sto"]) / 2) / [18.0, 12.0, 6.0]
        out += forward * np.exp(-(off**2).sum(axis=1) / 2)
    return start - out[:, None] * [0.0, 1.0, 0.0]


@pytest.fixture(scope="module")
def overhung(reference):
    """Cage (n, 3) mm of a mouth 4 mm open whose upper lip hangs over the lower: its edge, as a scan shows that, in front."""
    pairs = rest_of(reference).seen_pairs
    cage = reference.skin.vertices.copy()
    cage[pairs[:, 0]] += [0.0, -3.0, 2.0]
    cage[pairs[:, 1]] += [0.0, 1.0, -2.0]
    return cage


def test_full_lips_of_a_mouth_ajar_are_no_pursed_ones(reference):
    """They were taken for what orbicularis oris does, and a lip 3 mm forward went back with it."""
    for upper, lower in ((4.0, 4.0), (5.0, 3.0), (8.0, 0.0)):
        neutral = lips_forward(reference, upper, lower)
        result = relaxed(reference, neutral + responses().jaw_at(0.1), np.ones(len(neutral)))
        truth, found = (marks_on(reference, cage) for cage in (neutral, result.skin))
        assert not [name for name in result.report["muscles"] if name.startswith(("orbicularis_oris", "incisivus"))]
        for name in ("ls", "li"):
            assert abs(found[name][1] - truth[name][1]) < 1.2, name


def test_a_lip_that_hangs_over_moves_the_chin_little(reference, overhung):
    """How far one edge is before the other was explained by the jaw as well, which brought the chin forward by 4 mm."""
    result = relaxed(reference, overhung, np.ones(len(overhung)))
    found, before = (marks_on(reference, cage) for cage in (result.skin, reference.skin.vertices))
    assert np.linalg.norm(found["pg"] - before["pg"]) < 3.7


def test_pursed_lips_are_still_told(reference):
    table = responses()
    pursed = table.jaw_at(0.15) + sum(
        0.9 * field
        for name, field in zip(table.names, table.fields, strict=True)
        if name.startswith("orbicularis_oris")
    )
    start = reference.skin.vertices
    result = relaxed(reference, start + pursed, np.ones(len(start)))
    assert max(value for name, value in result.report["muscles"].items() if name.startswith("orbicularis_oris")) > 0.4
    truth, found, before = (marks_on(reference, cage) for cage in (start, result.skin, start + pursed))
    for name in ("ch_l", "ch_r"):
        assert np.linalg.norm(found[name] - truth[name]) < 0.5 * np.linalg.norm(before[name] - truth[name])


def test_lips_close_straight_up_and_down(reference, overhung):
    cage = overhung @ PLACED.T + [10.0, 20.0, 30.0]
    pairs, up = rest_of(reference).seen_pairs, PLACED[:, 2] / np.linalg.norm(PLACED[:, 2])
    out = lips_closed(rest_of(reference), cage, PLACED)
    moved = out - cage
    assert np.linalg.norm(moved, axis=1).max() > 1.5
    np.testing.assert_allclose(moved, np.outer(moved @ up, up), atol=1e-9)
    rest = reference.skin.vertices @ PLACED.T
    apart, usual = (((of[pairs[:, 0]] - of[pairs[:, 1]]) @ up) for of in (out, rest))
    np.testing.assert_allclose(apart, usual, atol=0.05)


def test_lips_meet_where_the_one_behind_is(reference, overhung):
    """The front of the lip that hangs over stays where it is."""
    rest, pairs = rest_of(reference), rest_of(reference).seen_pairs
    closed = lips_closed(rest, overhung, np.eye(3))
    out = lips_rounded(rest, closed, np.eye(3))
    middle = np.abs(reference.skin.vertices[pairs].mean(axis=1)[:, 0]) < 12
    upper, lower = (out[pairs[middle, k]] - closed[pairs[middle, k]] for k in (0, 1))
    assert upper[:, 1].min() > 3.0 and np.abs(lower[:, 1]).max() < 0.6
    apart, usual = (of[pairs[:, 0]] - of[pairs[:, 1]] for of in (out, reference.skin.vertices))
    np.testing.assert_allclose(apart, usual, atol=0.3)
    mark, before = (marks_on(reference, cage)["ls"] for cage in (out, closed))
    assert np.linalg.norm(mark - before) < 0.8


def test_lips_that_are_known_to_be_apart_count_though_few_landmarks_explain_it(reference):
    """Seven landmarks explain little of a gap; the lips of a head with a tube in its mouth stayed open for that."""
    start = reference.skin.vertices
    cage = start + responses().jaw_at(0.08)
    rows, quads = smoother(reference.skin.faces, len(cage))
    hidden = (rows @ np.asarray(reference.groups["inner"], dtype=float)) > 0.3
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    target = Surface(rows @ cage, triangles[~hidden[triangles].any(axis=1)])
    marks = marks_on(reference, cage)
    given = {name: marks[name] for name in FEW}
    known = parted_lips(reference, target, given, {name: marks[name] for name in ("ls", "li", "ch_l", "ch_r")})
    assert known is not None
    pairs = rest_of(reference).seen_pairs
    middle = pairs[np.abs(start[pairs].mean(axis=1)[:, 0]).argmin()]
    gap = np.linalg.norm(np.diff((start + known.expression.modelled)[middle], axis=0))
    assert LITTLE < gap < TOLD
