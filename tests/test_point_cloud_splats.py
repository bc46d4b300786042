# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats: points on those that are solid and of a surface, from the columns of PLY files."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from headshop.sim.errors import InputError
from headshop.sim.point_cloud.meshed import meshed
from headshop.sim.point_cloud.splats import HARMONIC, MOST, are_splats, on_splats
from headshop.sim.scan.ply import read_ply

RADIUS = 100.0
SOLID = 3.0  # as splats store it, before the logistic function


def ball(count=3000, wide=4.0, seed=1):
    """Flat splats in a ball's surface: middles, and standard deviations and axes, the third outward."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    u = np.cross(out, rng.normal(size=(count, 3)))
    u /= np.linalg.norm(u, axis=1)[:, None]
    axes = np.stack([u, np.cross(out, u), out], axis=2)
    return RADIUS * out, np.tile([wide, wide, 0.1], (count, 1)), Rotation.from_matrix(axes)


def columns(deviations, turns, opacity=SOLID, colour=(0.8, 0.5, 0.2), stretch=1.0):
    count = len(deviations)
    known = {f"scale_{k}": column for k, column in enumerate(np.log(deviations).T)}
    known |= {f"rot_{k}": column * stretch for k, column in enumerate(turns.as_quat()[:, [3, 0, 1, 2]].T)}
    colour = np.broadcast_to(colour, (count, 3))
    known |= {f"f_dc_{k}": (column - 0.5) / HARMONIC for k, column in enumerate(colour.T)}
    return known | {"opacity": np.broadcast_to(opacity, count)}


def test_points_lie_on_the_splats_and_between_their_middles():
    middles, deviations, turns = ball(1000, wide=6.0)
    known = columns(deviations, turns, stretch=1.7)
    cloud = on_splats(middles, known)
    assert are_splats(known) and not len(cloud.faces)
    owner = cKDTree(middles).query(cloud.vertices)[1]
    assert len(cloud.vertices) > 4 * len(middles) and len(np.unique(owner)) == len(middles)
    off = np.linalg.norm(cloud.vertices, axis=1) - RADIUS
    assert off.min() > -1e-6 and off.max() < 0.2  # a disc's border, 6 from where it touches
    np.testing.assert_allclose(cloud.colour, np.tile([0.8, 0.5, 0.2], (len(cloud.vertices), 1)), atol=1e-6)
    assert HARMONIC == pytest.approx(0.28209479177387814)


def test_long_splats_are_covered_along_and_strands_are_not():
    middles, deviations, turns = ball(400)
    deviations[:200, 0], deviations[200:, 0] = 16.0, 100.0
    cloud = on_splats(middles, columns(deviations, turns))
    axis = turns.as_matrix()[:, :, 0]
    owned = np.concatenate([np.full(9, k) for k in range(200)])
    for k in (0, 1, 150):
        own = cloud.vertices[np.abs((cloud.vertices - middles[k]) @ turns.as_matrix()[k][:, 2]) < 1e-9]
        along = (own - middles[k]) @ axis[k]
        assert along.max() == pytest.approx(16.0) and along.min() == pytest.approx(-16.0)
    assert len(cloud.vertices) < len(owned) + 4 * 200 + 200  # nine points or so on each long one, one on a strand


def test_haze_background_and_floaters_are_left_out():
    middles, deviations, turns = ball()
    rng = np.random.default_rng(2)
    haze, far, float_ = 1.1 * middles[:500], 9 * middles[500:1000], rng.uniform(-300, 300, (60, 3))
    float_ = float_[np.linalg.norm(float_, axis=1) > RADIUS + 40]
    points = np.concatenate([middles, haze, far, float_])
    wide = np.concatenate([deviations, deviations[:500], np.full((500, 3), 200.0), np.full((len(float_), 3), 2.0)])
    rows = [*range(3000), *range(1000), *range(len(float_))]
    opacity = np.where(np.arange(len(points)) // 500 == 6, -0.5, SOLID)
    own = rng.random((len(points), 3))
    mixed = rng.permutation(len(points))
    cloud = on_splats(points[mixed], columns(wide[mixed], turns[np.array(rows)[mixed]], opacity[mixed], own[mixed]))
    np.testing.assert_allclose(np.linalg.norm(cloud.vertices, axis=1), RADIUS, atol=0.2)
    away, nearest = cKDTree(middles).query(cloud.vertices)
    assert len(np.unique(nearest)) == len(middles)
    np.testing.assert_allclose(cloud.colour[away < 1e-9], own[nearest[away < 1e-9]], atol=1e-6)


def test_what_has_no_place_or_no_turn():
    middles, deviations, turns = ball()
    known = columns(deviations, turns)
    middles[0] = np.nan
    known["scale_1"][1] = np.inf
    for k in range(4):
        known[f"rot_{k}"][2] = 0
    cloud = on_splats(middles, known)
    assert np.isfinite(cloud.vertices).all()
    near = cKDTree(cloud.vertices).query(middles[1:4])[0]
    assert near[0] > 0.01 and near[1] < 1e-9 and near[2] < 1e-9
    assert not len(on_splats(middles, known | {"opacity": np.full(len(middles), -9.0)}).vertices)
    del known["f_dc_1"]
    assert on_splats(middles, known).colour is None


def test_their_number_is_bounded():
    middles, deviations, turns = ball(20_000)
    deviations[: len(middles) // 2 - 1, :2] = 40.0
    assert MOST / 2 < len(on_splats(middles, columns(deviations, turns)).vertices) < 2 * MOST


def test_a_file_of_splats_becomes_a_mesh(tmp_path):
    middles, deviations, turns = ball(6000)
    known = {axis: column for axis, column in zip("xyz", middles.T, strict=True)}
    known |= dict.fromkeys(("nx", "ny", "nz"), np.zeros(len(middles))) | columns(deviations, turns)
    path = tmp_path / "splats.ply"
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(middles)}"]
    head += [*(f"property float {name}" for name in known), "end_header", ""]
    path.write_bytes("\n".join(head).encode() + np.stack(list(known.values()), axis=1).astype("<f4").tobytes())
    cloud = read_ply(path)
    mesh = meshed(cloud)
    assert len(cloud.vertices) > len(middles) and cloud.normals is None
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - RADIUS).max() < 0.5
    np.testing.assert_allclose(mesh.colour.mean(axis=0), [0.8, 0.5, 0.2], atol=1e-3)
    del known["rot_3"]
    assert not are_splats(known)
    with pytest.raises(InputError, match="0 points"):
        meshed(on_splats(middles, columns(deviations, turns, opacity=-5.0)))
