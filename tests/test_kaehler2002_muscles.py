# SPDX-License-Identifier: GPL-3.0-or-later
"""The muscles of Kähler et al. 2002 on cases small enough for a hand: fibres, sphincters, bulge, merged axes."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.anatomy.head import Muscle
from headshop.sim.mesh import Mesh
from headshop.sim.tissue.kaehler2002.bulge import rise, swollen, volume
from headshop.sim.tissue.kaehler2002.fibres import arc_lengths, contracted
from headshop.sim.tissue.kaehler2002.merged import (
    aims,
    free_ends,
    interlaced,
    net_force,
    net_stiffness,
    numbered,
    settled,
    shared,
)
from headshop.sim.tissue.kaehler2002.parameters import DEFAULT
from headshop.sim.tissue.kaehler2002.sphincter import drawn_together, moved_centre
from headshop.sim.tissue.kaehler2002.structures import Axes

BENT = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0]])
NO_SHAPE = Mesh(np.zeros((0, 3)), np.zeros((0, 4), np.int32))


def _alone(points, contraction):
    start = np.arange(len(points)) == 0
    along = arc_lengths(points, start)
    return contracted(points, along, start, np.zeros(len(points), int), np.full(len(points), contraction))


def test_a_fibre_shortens_along_itself_by_hand():
    """8 mm round a corner, contracted by half: the tip stands on the corner, the middle half way to it."""
    here, turned = _alone(BENT, 0.5)
    assert here == pytest.approx(np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0]]))
    # the tip's tangent was +y, and at the corner it still is; by a little more it is +x
    assert turned[2] == pytest.approx([0, 0, 0])
    assert _alone(BENT, 0.6)[1][2] == pytest.approx([0, 0, -1.0])


def test_a_fibre_keeps_its_root_its_path_and_its_length_times_what_is_left():
    rng = np.random.default_rng(3)
    points = np.cumsum(rng.uniform(0.2, 1, size=(12, 3)), axis=0)
    assert _alone(points, 0.0)[0] == pytest.approx(points, abs=1e-12)
    here, _ = _alone(points, 0.3)
    assert here[0] == pytest.approx(points[0])
    away = np.linalg.norm(here[:, None] - np.linspace(points[:-1], points[1:], 400).reshape(-1, 3)[None], axis=2)
    assert away.min(axis=1).max() < 0.01
    start = np.arange(12) == 0
    reached = arc_lengths(np.concatenate([points, here[-1:]]), np.append(start, True))[:12]
    assert np.interp(here[-1, 0], points[:, 0], reached) == pytest.approx(0.7 * reached[-1], rel=1e-6)


def test_a_stretched_fibre_goes_on_straight():
    assert _alone(BENT, -0.25)[0][2] == pytest.approx([4, 6, 0])


def test_fibres_laid_end_to_end_do_not_feel_each_other():
    both = np.concatenate([BENT, BENT + [100.0, 0, 0]])
    start = np.array([1, 0, 0, 1, 0, 0], bool)
    fibre = np.array([0, 0, 0, 1, 1, 1])
    c = np.array([0.5, 0.5, 0.5, 0.2, 0.2, 0.2])
    here, _ = contracted(both, arc_lengths(both, start), start, fibre, c)
    assert here[:3] == pytest.approx(_alone(BENT, 0.5)[0])
    assert here[3:] == pytest.approx(_alone(BENT, 0.2)[0] + [100.0, 0, 0])


def test_a_sphincter_draws_together_by_hand_and_its_centre_moves_along_its_line():
    ring = np.array([[2.0, 0, 0], [0, 2, 0], [-2, 0, 0]])
    centre = np.zeros((3, 3))
    c = np.full(3, 0.25)
    assert drawn_together(ring, centre, c) == pytest.approx(0.75 * ring)
    line = np.tile([0.0, 0, 1], (3, 1))
    forward = drawn_together(ring, centre, c, np.full(3, 5.0), line)
    assert forward == pytest.approx(0.75 * ring + [0, 0, 5.0])
    assert moved_centre(centre, line, np.full(3, -2.0)) == pytest.approx(-2 * line)  # drawn back


def test_a_flat_ring_stays_on_its_surface():
    rng = np.random.default_rng(1)
    points, centre = rng.normal(size=(2, 20, 3))
    normal = rng.normal(size=(20, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    way = drawn_together(points, centre, np.full(20, 0.3), normal=normal) - points
    assert np.abs(np.einsum("ij,ij->i", way, normal)).max() < 1e-12
    assert np.einsum("ij,ij->i", way, centre - points).min() >= 0


@pytest.mark.parametrize("beside", [True, False])
def test_a_contracting_segment_bulges_and_keeps_its_volume(beside):
    ratio = np.linspace(0.5, 1.4, 10)
    width, height = swollen(ratio, 4.0, 2.0, beside)
    assert volume(6 * ratio, width, height) == pytest.approx(np.full(10, volume(6, 4, 2)))
    assert (np.diff(height) < 0).all()


def test_the_upper_side_rises_by_hand():
    """2 mm thick at 4/5 of its length: 2.5 mm thick, half of the gain above; none at the ends, less when stretched."""
    assert rise(0.8, 2.0, 1.0) == pytest.approx(0.25)
    assert rise(0.8, 2.0, 0.0) == 0 and rise(1.0, 2.0, 1.0) == 0 and rise(1.2, 2.0, 1.0) < 0


def _chain(roots, tips, nodes_between=1, share_tip=True):
    """Straight muscles from each root to its tip, which are one node if ``share_tip``."""
    k = len(roots)
    p = nodes_between + 2
    stations = np.concatenate([np.linspace(a, b, p) for a, b in zip(roots, tips, strict=True)]).astype(float)
    muscle = np.repeat(np.arange(k), p)
    first = np.flatnonzero(np.arange(k * p) % p != p - 1)
    pairs = (
        np.array([[p - 1, i * p + p - 1] for i in range(1, k)]).reshape(-1, 2) if share_tip else np.zeros((0, 2), int)
    )
    zero, total = np.zeros((k, 3)), np.linalg.norm(np.subtract(tips, roots), axis=1)
    return Axes(
        muscles=np.arange(k),
        round=np.zeros(k, bool),
        flat=np.zeros(k, bool),
        centre=zero,
        line=zero,
        lip=np.full(k, -1),
        slide=np.zeros(k),
        shortening=np.full(k, 0.3),
        stations=stations,
        muscle=muscle,
        along=np.tile(np.linspace(0, 1, p), k) * np.repeat(total, p),
        total=total,
        share=np.zeros(k * p),
        normal=np.zeros((k * p, 3)),
        node=numbered(pairs, np.arange(k * p) % p != 0),
        bed=np.ones(k * p),
        first=first,
        second=first + 1,
        owner=muscle[first],
        rest=np.linalg.norm(stations[first + 1] - stations[first], axis=1),
        stiffness=np.full(len(first), 600.0),
    )


def _settled(axes, contraction, parameters=DEFAULT):
    c = np.asarray(contraction, float)
    aim = aims(axes, axes.stations, axes.centre, axes.line, axes.normal, c, axes.slide * c)
    return aim, settled(axes, axes.stations, aim, c, parameters, 1e-6)


def test_a_muscle_alone_shortens_by_what_it_is_told():
    axes = _chain([[0, 0, 0]], [[10, 0, 0]], 3)
    _, x = _settled(axes, [1.0])
    assert x[-1] == pytest.approx([7.0, 0, 0], abs=1e-4)
    assert _settled(axes, [0.0])[1] == pytest.approx(axes.stations, abs=1e-9)


def test_a_merged_muscle_drags_the_common_node_and_stretches_its_partner():
    """Two springs of 10 mm on one node, one contracts to 7 mm, 41 times as stiff: the node is where forces balance."""
    axes = _chain([[0, 0, 0], [20, 0, 0]], [[10, 0, 0], [10, 0, 0]], 0)
    bare = replace(axes, bed=np.zeros(4))
    assert axes.count == 1 and axes.node[1] == axes.node[3]
    _, x = _settled(bare, [1.0, 0.0])
    u = x[1, 0]
    assert u == pytest.approx(x[3, 0])
    alive = 1 + DEFAULT.active
    assert alive * 600 * (u / 7 - 1) == pytest.approx(600 * ((20 - u) / 10 - 1), rel=1e-3)
    assert 7 < u < 7.2
    # both at once: neither wins, and the node stays
    assert _settled(axes, [1.0, 1.0])[1][1] == pytest.approx([10, 0, 0], abs=1e-4)


def test_forces_between_muscles_are_the_gradient_of_their_energy():
    rng = np.random.default_rng(5)
    axes = _chain([[0, 0, 0], [20, 3, 1], [5, 12, 2]], [[10, 0, 0]] * 3, 2)
    c = np.array([0.7, 0.0, 0.3])
    aim = aims(axes, axes.stations, axes.centre, axes.line, axes.normal, c, axes.slide * c)
    moved = rng.normal(size=(axes.count, 3))

    def of(u):
        return net_force(axes, axes.stations, aim, c, DEFAULT, u)

    way = rng.normal(size=moved.shape)
    slope = (of(moved + 1e-5 * way)[0] - of(moved - 1e-5 * way)[0]) / 2e-5
    assert slope == pytest.approx(-float((of(moved)[1] * way).sum()), rel=1e-5)
    bound = net_stiffness(axes, c, DEFAULT)
    assert (bound > 0).all()


def test_forces_of_the_springs_between_free_nodes_have_no_momentum():
    axes = _chain([[0, 0, 0], [20, 3, 1]], [[10, 0, 0]] * 2, 3)
    loose = replace(axes, node=numbered(np.array([[4, 9]]), np.ones(10, bool)), bed=np.zeros(10))
    moved = np.random.default_rng(2).normal(size=(loose.count, 3))
    _, force = net_force(loose, loose.stations, loose.stations, np.array([0.5, 0.0]), DEFAULT, moved)
    assert np.abs(force).max() > 1 and np.abs(force.sum(axis=0)).max() < 1e-9


def _muscle(name, fibres, kind="linear", ring=False):
    return Muscle(name, kind, np.asarray(fibres, float), 5.0, 1.0, 0.3, "skull", "soft", NO_SHAPE, ring)


def test_muscles_whose_fibres_end_together_merge_and_others_do_not():
    up = _muscle("up", [[[0, 0, 9], [0, 0, 0]]])
    down = _muscle("down", [[[0, 0, -9], [0, 0, 0.0]]])
    far = _muscle("far", [[[9, 0, 9], [9, 0, 3]]])
    arc = _muscle("arc", [[[0, 0, 0], [3, 0, 1], [6, 0, 1], [9, 0, 0]]], "sphincter")
    muscles = [up, down, far, arc]
    owner, tip = free_ends(muscles)
    assert list(zip(owner, tip, strict=True)) == [(0, 1), (1, 1), (2, 1), (3, 0), (3, 1)]
    pairs = shared(muscles, owner, tip)
    assert {tuple(p) for p in pairs} == {(0, 1), (0, 3), (1, 3)}
    # `far` shares no fibre, but ends 3.2 mm from the end of the arc: it is laced into it
    begin = np.array([0, 2, 4, 6])
    into = {tuple(p) for p in interlaced(muscles, begin, owner, tip, 4.0)}
    assert into == {(1, 6), (3, 6), (5, 9)}
