# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin of Kähler et al. 2002: springs, volume, skull and the leapfrog, on small cases and by their invariants."""

import numpy as np
import pytest

from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.tissue.kaehler2002.attachments import stacked
from headshop.sim.tissue.kaehler2002.leapfrog import DivergedError, advance, relax, stable_step
from headshop.sim.tissue.kaehler2002.parameters import DEFAULT
from headshop.sim.tissue.kaehler2002.posed import carried, turned_by
from headshop.sim.tissue.kaehler2002.skin_mesh import about_nodes, build_skin_mesh, mirrored
from headshop.sim.tissue.kaehler2002.skull import Skull, push, skull_energy
from headshop.sim.tissue.kaehler2002.structures import Attachments
from headshop.sim.tissue.kaehler2002.volume import build_prisms, corner_gather, prism_stiffness, volume_energy
from headshop.sim.tissue.springs import spring_energy
from headshop.sim.tissue.structures import Layers

NO_TIES = np.zeros((0, 2), int)


def _patch(side=6, depth=3.0, curve=0.02):
    """A bent square of skin, edges 2 mm, feet ``depth`` mm below; its springs over 3 n nodes."""
    step = 2.0 * np.arange(side)
    x, y = np.meshgrid(step, step, indexing="ij")
    skin = np.stack([x, y, -curve * (x**2 + y**2)], axis=-1).reshape(-1, 3)
    corner = np.arange(side * side).reshape(side, side)
    faces = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])
    n = len(skin)
    normal = vertex_normals(skin, triangles)
    one, free = np.ones(n), np.ones(2 * n, bool)
    foot = skin - depth * normal
    nodes = np.concatenate([skin, skin - 0.5 * depth * normal, foot])
    layers = Layers(nodes, 4 * one, one > 0, 0 * one, 0 * one, np.zeros(3 * n), normal, one, one, one, free)
    attachments = Attachments(foot, None, 0 * one, one)
    springs = build_skin_mesh(faces, skin, attachments, layers, NO_TIES, DEFAULT)
    return np.concatenate([skin, foot, mirrored(skin, foot)]), springs, triangles, layers


def _turned(x, seed=1):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return x @ (q * np.sign(np.linalg.det(q))).T + [10.0, -4, 7]


def _single():
    """One vertex 2 mm over its foot, held by foot and mirrored foot alone."""
    skin, foot = np.array([[0.0, 0, 2]]), np.zeros((1, 3))
    one, free = np.ones(1), np.ones(2, bool)
    nodes = np.array([[0.0, 0, 2], [0, 0, 1], [0, 0, 0]])
    layers = Layers(nodes, one, one > 0, 0 * one, 0 * one, np.zeros(3), np.array([[0.0, 0, 1]]), one, one, one, free)
    faces = np.zeros((0, 4), np.int32)
    attachments = Attachments(foot, None, 0 * one, one)
    springs = build_skin_mesh(faces, skin, attachments, layers, NO_TIES, DEFAULT)
    return springs, np.concatenate([skin, foot, mirrored(skin, foot)])


def test_foot_and_mirrored_foot_hold_a_vertex_between_them_by_hand():
    """Pressed in by 0.5 mm both springs push out, k * 0.5 each; aside the force grows with the cube."""
    springs, rest = _single()
    assert rest[2] == pytest.approx([0, 0, 4])
    k = DEFAULT.attachment_area

    def force(aside, up):
        x = rest + np.array([[aside, 0, up], [0, 0, 0], [0, 0, 0]])
        return -spring_energy(springs, x)[1][0]

    assert force(0, 0) == pytest.approx([0, 0, 0])
    assert force(0, -0.5) == pytest.approx([0, 0, 2 * k * 0.5])
    assert force(0, 0.5) == pytest.approx([0, 0, -2 * k * 0.5])
    small, double = force(0.01, 0)[0], force(0.02, 0)[0]
    assert small < 0 and double / small == pytest.approx(8, rel=1e-3)
    stretched = np.hypot(3, 2)
    assert force(3, 0) == pytest.approx([-2 * k * (stretched - 2) * 3 / stretched, 0, 0])


def test_the_skin_at_rest_and_moved_as_a_whole_feels_nothing():
    nodes, springs, _, _ = _patch()
    for x in (nodes, _turned(nodes)):
        energy, gradient = spring_energy(springs, x)
        assert energy < 1e-20 and np.abs(gradient).max() < 1e-10


def test_internal_forces_have_no_momentum_and_turn_with_the_body():
    nodes, springs, triangles, layers = _patch()
    x = nodes + np.random.default_rng(0).normal(size=nodes.shape) * 0.4
    prisms, rest = build_prisms(nodes, triangles, layers.free[: len(triangles)][:36])
    gather = corner_gather(prisms, len(nodes))
    for value in (
        lambda y: spring_energy(springs, y),
        lambda y: volume_energy(y, prisms, rest, DEFAULT.volume, gather),
    ):
        energy, gradient = value(x)
        assert np.abs(gradient).max() > 0.1
        assert np.abs(gradient.sum(axis=0)).max() < 1e-9
        assert np.abs(np.cross(x, gradient).sum(axis=0)).max() < 1e-7
        assert value(_turned(x))[0] == pytest.approx(energy)


def test_volume_pushes_back_by_hand():
    """A right prism over 3 by 4, 2 high, pressed to 1 high: pressure k/2 on the 6 mm² above, 2 mm² worth per corner."""
    corners = np.array([[0.0, 0, 2], [3, 0, 2], [0, 4, 2], [0, 0, 0], [3, 0, 0], [0, 4, 0]])
    prisms, rest = build_prisms(corners, np.array([[0, 1, 2]]), np.ones(3, bool))
    assert rest == pytest.approx([12.0])
    pressed = corners - np.array([[0, 0, 1.0]] * 3 + [[0, 0, 0]] * 3)
    energy, gradient = volume_energy(pressed, prisms, rest, 10.0, corner_gather(prisms, 6))
    assert energy == pytest.approx(0.5 * 10 * 6**2 / 12)
    assert gradient[:3, 2] == pytest.approx([-10 * 0.5 * 2] * 3)
    bound = prism_stiffness(pressed, prisms, rest, 10.0, 3)
    assert (bound >= 10 / 12 * 2**2 - 1e-9).all()  # at least the vertical one alone
    flat = corners * [1, 1, 0.1]
    assert len(build_prisms(flat, np.array([[0, 1, 2]]), np.ones(3, bool))[0]) == 0


def test_the_skull_pushes_by_hand_and_as_its_energy_says():
    """Margin 1, k 3: free beyond it, k (m - h) m / h at half of it, eight times k (m - h) on the bone and under it."""
    height = np.array([2.0, 1.0, 0.5, 0.125, 0.0, -0.5])
    _, force = push(height, np.ones(6), np.full(6, 3.0))
    assert force == pytest.approx([0, 0, 3.0, 3 * 0.875 * 8, 3 * 8, 3 * 1.5 * 8])
    grid = np.linspace(-0.4, 1.2, 33)
    m, k = np.ones(33), np.full(33, 3.0)
    slope = (push(grid + 1e-6, m, k)[0] - push(grid - 1e-6, m, k)[0]) / 2e-6
    assert -slope == pytest.approx(push(grid, m, k)[1], abs=1e-4)


def test_no_vertex_passes_the_skull():
    """Pressed onto bone by twice k m, vertices stay above it and come to rest at a third of the margin, as h = m / 3 says;
    bone that comes to meet them pushes those it belongs to."""
    one = np.ones(3)
    at = np.array([[0.0, 0, 3], [1, 0, 0.9], [2, 0, 0.4]])
    up = np.tile([0.0, 0, 1], (3, 1))
    skull = Skull(np.arange(3), at * [1, 1, 0], up, np.array([1.0, 1, 0]), one, np.full(3, 50.0))
    energy, gradient = skull_energy(at, skull, np.eye(3), np.array([0.0, 0, 0.5]))
    assert energy > 0 and gradient[0] == pytest.approx([0, 0, 0]) and (gradient[1:, 2] < 0).all()

    def force(x, _):
        return -skull_energy(x, skull, np.eye(3), np.zeros(3))[1] - [0, 0, 100.0]

    x, v = at, np.zeros((3, 3))
    for _ in range(600):
        x, v = advance(force, x, v, one, 1e-2, damping=20.0)
        assert (x[:, 2] > 0).all()
    assert x[:, 2] == pytest.approx(np.full(3, 1 / 3), abs=1e-3)


def test_leapfrog_falls_and_swings_as_it_should():
    """A fall is exact; a spring of omega 2 pi is back after a second, to second order in dt."""
    mass = np.array([2.0])
    fall = advance(lambda x, _: np.array([[0.0, 0, -20]]), np.zeros((1, 3)), np.zeros((1, 3)), mass, 0.1, steps=10)
    assert fall[0][0, 2] == pytest.approx(-5.0) and fall[1][0, 2] == pytest.approx(-10.0)
    off = []
    for steps in (50, 100):
        start = np.array([[1.0, 0, 0]])
        k = mass[:, None] * (2 * np.pi) ** 2
        x, v = advance(lambda x, _, k=k: -k * x, start, 0 * start, mass, 1 / steps, steps=steps)
        off.append(np.linalg.norm(v))
        assert x == pytest.approx(start, abs=2e-3)
    assert off[0] / off[1] == pytest.approx(4, rel=0.05)


def _patch_force(springs, nodes):
    n = len(nodes) // 3

    def force(skin, _):
        return -spring_energy(springs, np.concatenate([skin, nodes[n:]]))[1][:n]

    return n, force


def test_leapfrog_runs_backwards_without_damping_and_loses_energy_with_it():
    nodes, springs, _, _ = _patch()
    n, force = _patch_force(springs, nodes)
    mass = np.full(n, 0.02)
    start = nodes[:n] + np.random.default_rng(4).normal(size=(n, 3)) * 0.3
    still = np.zeros((n, 3))
    dt = stable_step(about_nodes(springs, n), mass) / 2

    def energy(x, v):
        return spring_energy(springs, np.concatenate([x, nodes[n:]]))[0] + 0.5 * float(mass @ (v**2).sum(axis=1))

    x, v = advance(force, start, still, mass, dt, steps=300)
    assert np.abs(x - start).max() > 0.1
    assert energy(x, v) == pytest.approx(energy(start, still), rel=0.05)
    back, velocity = advance(force, x, -v, mass, dt, steps=300)
    assert back == pytest.approx(start, abs=1e-8) and np.abs(velocity).max() < 1e-6
    x, v, before = start, still, energy(start, still)
    for _ in range(20):
        x, v = advance(force, x, v, mass, dt, damping=5.0, steps=25)
        assert energy(x, v) < before
        before = energy(x, v)


def test_too_long_a_step_is_an_error_not_a_number():
    nodes, springs, _, _ = _patch()
    n, force = _patch_force(springs, nodes)
    mass = np.full(n, 0.02)
    start = nodes[:n] + 0.01 * np.random.default_rng(4).normal(size=(n, 3))
    dt = stable_step(about_nodes(springs, n), mass)
    advance(force, start, 0 * start, mass, dt, steps=400)
    with pytest.raises(DivergedError, match="shorten the time step"):
        advance(force, start, 0 * start, mass, 10 * dt, steps=400)


def test_relaxation_finds_the_rest_that_a_linear_solve_finds():
    rng = np.random.default_rng(8)
    n = 30
    a = np.diag(np.full(n, 2.0)) - np.eye(n, k=1) - np.eye(n, k=-1)
    load = rng.normal(size=(n, 3))
    x, left, steps = relax(lambda x: load - a @ x, np.zeros((n, 3)), np.abs(a).sum(axis=1) / 2, 1e-6, 5000)
    assert x == pytest.approx(np.linalg.solve(a, load), abs=1e-3) and left <= 1e-6 and steps < 2000


def test_relaxation_recovers_from_a_stiffness_told_too_low_and_gives_up_in_words():
    def hard(x):
        return -40.0 * x

    x, left, _ = relax(hard, np.ones((4, 3)), np.full(4, 1.0), 1e-4, 500)
    assert np.abs(x).max() < 1e-3 and left <= 1e-4
    with pytest.raises(DivergedError):
        relax(lambda x: 1e9 * x, np.ones((2, 3)), np.ones(2), 1e-4, 500)


def test_the_topmost_muscle_takes_most_and_bone_what_is_left():
    share = stacked(np.array([[1.0, 1, 0, 1], [1, 0.5, 0, 1]]), np.array([[5.0, 1, 1, 2], [2, 3, 2, 2]]), 0.8)
    assert share.sum(axis=0) == pytest.approx([1 - 0.2**2, 1 - 0.2 * 0.6, 0, 1 - 0.2**2])
    assert share[0] / np.maximum(share[1], 1e-9) == pytest.approx([np.exp(-3), 2 * np.exp(2), 0, 1])


def test_turning_keeps_length_and_carrying_goes_by_share():
    rng = np.random.default_rng(0)
    offset = rng.normal(size=(9, 3))
    vector = rng.normal(size=(9, 3)) * 0.3
    assert np.linalg.norm(turned_by(vector, offset), axis=1) == pytest.approx(np.linalg.norm(offset, axis=1))
    assert turned_by(np.array([[0, 0, 1.0]]), np.array([[2.0, 0, 0]])) == pytest.approx(np.array([[0, 2.0, 0]]))
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = carried(np.array([[1.0, 0, 0]] * 3), np.array([0, 1, 0.5]), quarter, np.array([0, 0, 2.0]))
    assert moved == pytest.approx(np.array([[1, 0, 0], [0, 1, 2], [0.5, 0.5, 1]]))


def test_the_patch_is_a_mesh_whose_edges_became_springs():
    nodes, springs, triangles, layers = _patch()
    n = len(layers.area)
    kinds = np.bincount(springs.kind, minlength=5)
    # 60 edges and 50 diagonals of 25 quads; foot and mirrored foot each; two struts an edge
    assert list(kinds) == [110, n, n, 120, 0]
    assert Mesh(nodes[:n], triangles.astype(np.int32)).vertices.shape == (36, 3)
