# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxation of voids, the Laplacian field and the search for features in range maps."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from headshop.sim.adapt.build import fit_report
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.completion import sigma
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.cylindrical.adaptation import adapt
from headshop.sim.cylindrical.features import VAGUE, find_features
from headshop.sim.cylindrical.grid_mesh import to_mesh
from headshop.sim.cylindrical.laplacian import edge_field, laplacian_field
from headshop.sim.cylindrical.map_files import read_range_map, write_range_map
from headshop.sim.cylindrical.pose import find_pose
from headshop.sim.cylindrical.range_map import RangeMap, resample
from headshop.sim.cylindrical.relaxation import filled, relaxed
from headshop.sim.cylindrical.second_opinion import weighed
from headshop.sim.cylindrical.springs import relax
from headshop.sim.cylindrical.unroll import unrolled
from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.progress import finish
from headshop.sim.scan.ply import read_ply


def around(radius, colour=None):
    h, w = radius.shape
    step = 2 * np.pi / w
    valid = np.isfinite(radius)
    return RangeMap(radius, valid, colour, -np.pi + step / 2, step, h / 2, 1.0, np.zeros(3), np.eye(3))


def test_a_membrane_is_harmonic_and_a_plate_keeps_slopes():
    y, x = np.mgrid[:40, :60]
    slope = 0.3 * x + 0.1 * y
    known = np.ones(slope.shape, dtype=bool)
    known[12:30, 20:45] = False
    for tension in (1.0, 0.0):  # both pass a plane exactly
        np.testing.assert_allclose(relaxed(np.where(known, slope, np.nan), known, False, tension), slope, atol=1e-5)
    bowl = 0.02 * ((x - 30.0) ** 2 + (y - 20.0) ** 2)
    flat = relaxed(np.where(known, bowl, 0), known, False, 1.0)
    assert abs(flat[19:22, 30:33].sum() - 9 * flat[20, 31]) < 0.02  # the mean of what is around
    assert flat[20, 31] > 1.0  # flattened
    deep = relaxed(np.where(known, bowl, 0), known, False, 0.0)
    assert np.abs(deep - bowl).max() < 0.15 * np.abs(flat - bowl).max()
    assert np.array_equal(deep[known], bowl[known])


def test_voids_at_the_seam_close_from_both_sides():
    longitude = np.linspace(-np.pi, np.pi, 80, endpoint=False)
    wave = np.tile(np.cos(longitude), (20, 1))
    known = np.ones(wave.shape, dtype=bool)
    known[:, :6] = known[:, -6:] = False
    closed = relaxed(np.where(known, wave, 0), known, True, 1.0)
    np.testing.assert_allclose(closed, relaxed(np.where(known, wave, 0)[:, ::-1], known[:, ::-1], True, 1.0)[:, ::-1])
    assert np.abs(np.diff(np.concatenate([closed[:, -3:], closed[:, :3]], axis=1), axis=1)).max() < 0.02
    assert np.abs(relaxed(np.where(known, wave, 0), known, True, 0.0) - wave).max() < 0.02


def test_large_voids_are_solved_coarse_to_fine_like_small_ones_directly(monkeypatch):
    from headshop.sim.cylindrical import relaxation

    y, x = np.mgrid[:80, :96]
    surface = 20 * np.sin(x / 96 * 2 * np.pi) + 10 * np.cos(y / 30)
    known = ((x - 50) ** 2 + (y - 40) ** 2 > 30**2) & (x > 3)
    exact = {t: relaxed(np.where(known, surface, 0), known, True, t) for t in (0.0, 1.0)}
    monkeypatch.setattr(relaxation, "DIRECT", 200)
    for tension, values in exact.items():
        again = relaxed(np.where(known, surface, 0), known, True, tension)
        assert np.abs(again - values).max() < 0.03 * np.ptp(surface)


def test_range_and_colour_are_filled_where_they_are_void():
    radius = np.full((30, 64), 90.0)
    colour = np.full((30, 64, 3), 0.5, dtype=np.float32)
    radius[10:15, 20:26] = np.nan
    colour[3:8, 40:50] = np.nan
    made = filled(around(radius, colour))
    assert made.valid.all()
    np.testing.assert_allclose(made.radius, 90, atol=1e-4)
    np.testing.assert_allclose(made.colour, 0.5, atol=1e-4)
    with pytest.raises(ValueError, match="nothing is known"):
        relaxed(radius, np.zeros(radius.shape, dtype=bool), True)


def test_creases_and_edges_show_in_their_fields_only():
    radius = np.full((60, 200), 90.0)
    radius[:, 100] -= 6.0  # a furrow downward
    radius[30] += 6.0  # a ridge around
    made = around(radius)
    crease, edge = laplacian_field(made), edge_field(made)
    assert crease.min() >= 0 and edge.min() >= 0
    assert crease[10].argmax() == 100 and edge[:, 20].argmax() == 30
    assert crease[30, 100] > 5 * np.median(crease[30])  # not cancelled by the ridge that crosses it
    assert made.closed and np.allclose(crease[:, 0], crease[:, -1])


@pytest.fixture(scope="module")
def person(reference):
    """Nobody, turned and tilted a little, and the true landmarks."""

    def shape(points):  # a longer, narrower face with a wider jaw, a nose and a mouth that are off their place
        bump = np.exp(-(((points - [0, -100, -20]) / 25.0) ** 2).sum(axis=-1))[..., None]
        low = np.clip((-points[..., 2:] - 20) / 80, 0, 1)
        return points * [0.95, 1.03, 1.07] + bump * [0, -5.0, -4.0] + low * points * [0.06, 0, 0]

    c, s = np.cos(0.25), np.sin(0.25)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, 0.995, -0.0998], [0, 0.0998, 0.995]])
    marks = {n: turn @ shape(p) + [20, -30, 40] for n, p in reference.landmark_positions().items()}
    outer = np.asarray(reference.groups["inner"]) < 0.5
    skin = reference.skin
    faces = skin.faces[np.where(skin.faces >= 0, outer[skin.faces], True).all(axis=1)]
    return Mesh(shape(skin.vertices) @ turn.T + [20, -30, 40], faces), marks, turn


def test_the_pose_of_a_face_is_found_at_any_longitude(reference, person):
    mesh, marks, turn = person
    made = resample(mesh)
    moved = made.moved(np.array([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]]))  # the face looks to the back
    for a_map, rotation in ((made, turn), (moved, np.diag([-1.0, -1, 1]) @ turn)):
        pose = find_pose(a_map, reference)
        angle = np.degrees(np.arccos(np.clip((np.trace(pose.rotation.T @ rotation) - 1) / 2, -1, 1)))
        assert angle < 7


@pytest.fixture(scope="module")
def holed(reference, person):
    """The person's map with a hole in the cheek, the true landmarks, and the features found."""
    mesh, marks, _ = person
    made = resample(mesh, 384, 192)
    row, column, _ = made.texels(marks["zy_l"])
    made.valid[int(row) - 8 : int(row) + 8, int(column) - 8 : int(column) + 8] = False
    made.radius[~made.valid] = np.nan
    return made, marks, finish(find_features(made, reference))


def test_features_are_found_with_a_hole_in_the_face(holed):
    _, marks, found = holed
    off = {n: np.linalg.norm(found.positions[n] - p) for n, p in marks.items()}
    sharp = [n for n in off if sigma(n) < 2]
    assert np.mean([off[n] for n in sharp]) < 3.0
    assert off["prn"] < 4 and max(off["en_l"], off["en_r"], off["sto"], off["ch_l"], off["ch_r"]) < 6
    assert all(0 < c <= 1 for c in found.confidence.values())
    left = [n for n in off if n.endswith("_l")]
    across = [found.positions[n] - found.positions[n[:-1] + "r"] for n in left]
    true = [marks[n] - marks[n[:-1] + "r"] for n in left]
    assert all(a @ b > 0 for a, b in zip(across, true, strict=True))


def test_a_wall_has_no_nose(reference):
    with pytest.raises(InputError, match="nose"):
        find_pose(around(np.full((60, 128), 90.0)), reference)


def test_the_ten_steps_lay_the_generic_head_on_the_map(reference, holed):
    made, marks, found = holed
    adapted = finish(adapt(made, reference, found))
    assert adapted.error["mean"] < 0.6 and adapted.error["p95"] < 2.0 and adapted.error["coverage"] > 0.85
    assert len(adapted.skin.vertices) == len(reference.skin.vertices)
    assert 0.4 < adapted.sampled.mean() < 0.9 and np.isfinite(adapted.skin.vertices).all()
    placed = reference.landmarks.on({"skin": adapted.skin.vertices})
    sharp = [n for n in marks if sigma(n) < 2]
    assert np.mean([np.linalg.norm(placed[n] - marks[n]) for n in sharp]) < 4.5
    normals = vertex_normals(adapted.skin.vertices, adapted.skin.triangles)
    front = (np.asarray(reference.groups["face"]) > 0.5) & adapted.sampled
    out = adapted.skin.vertices - (adapted.map.origin + [0, 0, 1] * (adapted.skin.vertices - adapted.map.origin))
    assert (np.einsum("ij,ij->i", normals, out)[front] > 0).mean() > 0.97  # no triangle turned over
    # texture coordinates lead each corner to its own texel
    h, w = adapted.map.shape
    u, v = adapted.skin.uv[:, 0].T
    corner = adapted.skin.vertices[adapted.skin.faces[:, 0]]
    seen = adapted.sampled[adapted.skin.faces[:, 0]]
    back = adapted.map.place((1 - v) * h - 0.5, u * w - 0.5)
    assert np.median(np.linalg.norm(back - corner, axis=1)[seen]) < 0.3
    assert np.ptp(adapted.skin.uv[seen][..., :3, 0], axis=1).max() < 0.5  # no face spans the whole picture


def test_springs_at_rest_stay_and_pins_pull(reference):
    side = np.arange(12.0)
    flat = np.stack(np.meshgrid(10 * side, 5 * side), axis=-1).reshape(-1, 2)
    corner = np.arange(144).reshape(12, 12)
    links = np.concatenate([np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1).reshape(-1, 2)])  # around
    links = np.concatenate([links, np.stack([corner[:-1], corner[1:]], axis=-1).reshape(-1, 2)])
    pins = csr_matrix(([1.0], ([0], [66])), shape=(1, 144))
    still = relax(flat, links, pins, flat[[66]], np.array([10.0]), 120.0)
    np.testing.assert_allclose(still, flat, atol=1e-3)
    moved = relax(flat, links, pins, flat[[66]] + [4.0, -3.0], np.array([1e4]), 120.0)
    np.testing.assert_allclose(moved[66], flat[66] + [4.0, -3.0], atol=0.05)
    off = np.linalg.norm(moved - flat, axis=1)
    assert off[66] == off.max() and off[65] > 0.5 and np.isfinite(off).all()


def test_landmarks_that_are_off_are_drawn_to_the_features_of_the_map(reference, person):
    mesh, marks, _ = person
    turn = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]])  # a head lying on its side is as good
    mesh = mesh.moved(mesh.vertices @ turn.T)
    surface = Surface(mesh.vertices, mesh.triangles)
    off = {
        n: turn @ p + v for (n, p), v in zip(marks.items(), np.random.default_rng(4).normal(0, 3, (60, 3)), strict=True)
    }
    off = {n: surface.closest(p[None]).points[0] for n, p in off.items()}
    better = finish(weighed(mesh, off, dict.fromkeys(off, 1.0), reference, surface))
    assert list(better) == list(off)

    def error(positions):
        return np.mean([np.linalg.norm(positions[n] - turn @ p) for n, p in marks.items() if sigma(n) < 2])

    assert error(better) < 0.8 * error(off)
    assert surface.closest(np.array(list(better.values()))).distance.max() < 1e-6
    few = {n: off[n] for n in ("prn", "ex_l", "ex_r")}
    assert finish(weighed(mesh, few, dict.fromkeys(few, 1.0), reference, surface)) is few


def test_a_scanners_patch_is_fitted_from_its_own_map_alone(reference, shared, tmp_path):
    scan = read_ply(shared / "scans" / "fran_cyberware.ply")
    write_range_map(tmp_path / "patch.ech", unrolled(scan))  # 49 x 45 texels, colours beside
    made = read_range_map(tmp_path / "patch.ech")
    found = finish(find_features(made, reference))
    true = read_landmarks(shared / "scans" / "fran_cyberware.landmarks.json")
    assert np.mean([np.linalg.norm(found.positions[n] - p) for n, p in true.items()]) < 5.5
    sure = {n: p for n, p in found.positions.items() if n not in found.in_void and n not in VAGUE}
    mesh = to_mesh(made)
    fit = finish(fit_skin(reference, Surface(mesh.vertices, mesh.triangles, smooth=2.0), sure))
    report = fit_report(reference, fit, sure)
    assert report["mean_mm"] < 0.3 and report["p95_mm"] < 1.0 and report["coverage"] > 0.75
