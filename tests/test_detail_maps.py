# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail maps against surfaces whose height is known: texels lie where they should, heights, normals, holes."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from headshop.sim.adapt.closest import Surface
from headshop.sim.detail.chart import chart_of, texels
from headshop.sim.detail.detail_map import DEEPEST
from headshop.sim.detail.maps import detail_maps
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import Progress, finish

SIZE = 256


def _drawn(reference, levels):
    """The reference's drawn skin, finer than its cage: (vertices, normals, triangles) of what is outside."""
    skin = reference.skin
    operator, quads = smoother(skin.faces, len(skin.vertices), levels)
    outside = (operator @ np.asarray(reference.groups["inner"]) < 0.5)[quads].all(axis=1)
    triangles = np.concatenate([quads[outside][:, [0, 1, 2]], quads[outside][:, [0, 2, 3]]])
    vertices = operator @ skin.vertices
    return vertices, vertex_normals(vertices, triangles), triangles


@pytest.fixture(scope="module")
def scan(reference):
    """Two steps finer: its triangles lie up to 0.1 mm under the surface that its vertices lie on."""
    return _drawn(reference, 2)


def _maps(reference, scan, height, lost=None, size=SIZE):
    vertices, normals, triangles = scan
    if lost is not None:
        triangles = triangles[~lost[triangles].any(axis=1)]
    target = Surface(vertices + height[:, None] * normals, triangles)
    return finish(detail_maps(reference.skin, target, reference.groups["inner"], size))


def _at(reference, values, name):
    """A map's value at a landmark."""
    k = reference.landmarks.names.index(name)
    corner, weights = reference.landmarks.corners[k], reference.landmarks.weights[k]
    faces, uv = reference.skin.faces, reference.skin.uv
    face = np.flatnonzero(np.isin(faces, corner).sum(axis=1) == 3)[0]
    place = sum(w * uv[face][list(faces[face]).index(c)] for c, w in zip(corner, weights, strict=True))
    return map_coordinates(values, [[place[1] * SIZE - 0.5], [place[0] * SIZE - 0.5]], order=1)[0]


def test_texels_lie_on_the_drawn_surface_and_tile_the_chart(reference):
    chart = chart_of(reference.skin)
    cover = texels(chart, np.ones(len(chart.triangles), dtype=bool), SIZE)
    faces, uv = reference.skin.faces, reference.skin.uv.astype(float)
    a, b, c, d = (uv[:, k] for k in range(4))
    diagonals = np.stack([c - a, d - b], axis=1)
    area = np.abs(np.linalg.det(diagonals)).sum() / 2
    assert len(np.unique(cover.index)) == len(cover.index)
    assert len(cover.index) / SIZE**2 == pytest.approx(area, rel=0.01)
    where = cover.across(chart, chart.uv) * SIZE  # each texel's own place in the chart is its middle
    np.testing.assert_allclose(where[:, 0], cover.index % SIZE + 0.5, atol=0.02)
    np.testing.assert_allclose(where[:, 1], cover.index // SIZE + 0.5, atol=0.02)
    fine, quads = smoother(faces, len(reference.skin.vertices), 3)
    surface = Surface(fine @ reference.skin.vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    assert np.quantile(surface.closest(cover.points(chart)[::197]).distance, 0.99) < 0.04


def test_tangents_make_the_frame_of_a_normal_map(reference):
    """Along u the tangent, along v the bitangent N x T: no part of the chart is mirrored."""
    chart = chart_of(reference.skin)
    bitangent = np.cross(chart.normals, chart.tangents)
    outside = chart.cage @ np.asarray(reference.groups["inner"]) < 0.2
    for way, axis in ((chart.along_u, chart.tangents), (chart.along_v, bitangent)):
        cosine = np.einsum("ij,ij->i", way, axis) / np.linalg.norm(way, axis=1)
        assert np.quantile(cosine[outside], 0.05) > 0.55 and (cosine[outside] > 0).mean() > 0.999


def test_a_scan_on_the_skin_leaves_the_maps_flat(reference):
    scan = _drawn(reference, 3)
    maps = _maps(reference, scan, np.zeros(len(scan[0])))
    assert maps.displacement.shape == (SIZE, SIZE) and maps.displacement.dtype == np.float32
    assert np.quantile(np.abs(maps.displacement), 0.99) < 0.03
    assert np.quantile(maps.normal[..., 2], 0.02) > 0.99
    np.testing.assert_allclose(np.linalg.norm(maps.normal, axis=2), 1, atol=1e-5)


def test_a_bump_comes_out_at_its_height_and_tilts_the_normals(reference, scan):
    at = reference.landmark_positions()
    place = at["g"] + [0, 0, 22.0]
    bump = 0.8 * np.exp(-((scan[0] - place) ** 2).sum(axis=1) / (2 * 8.0**2))
    maps = _maps(reference, scan, bump)
    found = maps.displacement.max()
    assert 0.7 < found < 0.85
    v, u = np.unravel_index(maps.displacement.argmax(), maps.displacement.shape)
    # The slope of the bump: steepest 8 mm away, 0.8 / 8 exp(-1/2); right of it the surface looks right (+x), above up.
    window = maps.normal[v - 20 : v + 21, u - 20 : u + 21]
    steep = 0.8 / 8 * np.exp(-0.5)
    assert window[20, 21:, 0].max() == pytest.approx(steep, rel=0.25)
    assert window[20, :20, 0].min() == pytest.approx(-steep, rel=0.25)
    assert window[21:, 20, 1].max() == pytest.approx(steep, rel=0.25)
    assert window[:20, 20, 1].min() == pytest.approx(-steep, rel=0.25)


def test_raised_skin_lies_nearer_to_the_scan(reference, scan):
    x, y, z = scan[0].T
    waves = 0.3 * np.sin(x / 5) * np.sin(z / 5)
    maps = _maps(reference, scan, waves, size=512)
    chart = chart_of(reference.skin)
    front = (chart.vertices[:, 1] < -60) & (chart.cage @ np.asarray(reference.groups["inner"]) < 0.01)
    height = map_coordinates(maps.displacement, (chart.uv[:, ::-1].T * 512 - 0.5), order=1, mode="nearest")
    target = Surface(scan[0] + waves[:, None] * scan[1], scan[2])
    before = target.closest(chart.vertices[front][::5]).distance
    after = target.closest((chart.vertices + height[:, None] * chart.normals)[front][::5]).distance
    assert after.mean() < 0.35 * before.mean()


def test_detail_fades_out_where_the_scan_has_none(reference, scan):
    """A raised scan with the left half missing: nothing there, no step at the rim; a small hole is closed."""
    at = reference.landmark_positions()
    place = scan[0][np.linalg.norm(scan[0] - (at["zy_r"] + at["ch_r"]) / 2, axis=1).argmin()]
    hole = np.linalg.norm(scan[0] - place, axis=1) < 1.5
    maps = _maps(reference, scan, np.full(len(scan[0]), 0.5), lost=(scan[0][:, 0] > 8) | hole)
    assert abs(_at(reference, maps.displacement, "zy_l")) < 0.01
    assert _at(reference, maps.displacement, "g") > 0.2
    chart = chart_of(reference.skin)
    cover = texels(chart, np.ones(len(chart.triangles), dtype=bool), SIZE)
    inside = np.linalg.norm(cover.points(chart) - place, axis=1) < 2
    assert inside.any() and maps.displacement.ravel()[cover.index[inside]].min() > 0.2
    covered = np.zeros((SIZE, SIZE), dtype=bool)
    covered.ravel()[cover.index] = True
    steps = np.abs(np.diff(maps.displacement, axis=1))[covered[:, 1:] & covered[:, :-1]]
    assert steps.max() < 0.4


def test_no_map_is_deep_however_far_the_scan_is(reference, scan):
    maps = _maps(reference, scan, np.full(len(scan[0]), 2.6))
    assert np.abs(maps.displacement).max() <= DEEPEST
    far = _maps(reference, scan, np.full(len(scan[0]), 9.0))
    assert np.quantile(np.abs(far.displacement), 0.9) < 0.05, "another surface is no detail"


def test_progress_comes_often_and_can_be_stopped(reference, scan):
    target = Surface(scan[0], scan[2])
    work = detail_maps(reference.skin, target, reference.groups["inner"], SIZE)
    steps = [next(work) for _ in range(4)]
    assert all(isinstance(step, Progress) for step in steps)
    work.close()
    steps = []
    finish(detail_maps(reference.skin, target, reference.groups["inner"], SIZE), steps.append)
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and len(steps) > 6


def test_the_same_scan_gives_the_same_bytes(reference, scan):
    height = 0.2 * np.sin(scan[0][:, 0])
    one, other = (_maps(reference, scan, height) for _ in range(2))
    assert one.displacement.tobytes() == other.displacement.tobytes() and one.normal.tobytes() == other.normal.tobytes()


def test_a_mesh_without_colours_or_materials_has_maps_too(reference, scan):
    """Only vertices, faces and UVs are needed."""
    bare = Mesh(reference.skin.vertices, reference.skin.faces, uv=reference.skin.uv)
    maps = finish(detail_maps(bare, Surface(scan[0], scan[2]), np.zeros(len(bare.vertices)), 64))
    assert maps.report["size"] == 64 and maps.report["rms_mm"] < 0.1
