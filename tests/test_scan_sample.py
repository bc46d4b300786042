# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample: a plausible person, exact truth, a scan as raw as real ones, the same bytes for the same seed."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.errors import InputError
from headshop.sim.health.eyes import lid_gaps
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan, components
from headshop.sim.scan.individual import draw_field, individual
from headshop.sim.scan.ply import read_ply
from headshop.sim.scan.sample import make_sample, write_sample
from headshop.sim.scan.scanner import VirtualScanner


@pytest.fixture(scope="module")
def sample(reference):
    return finish(make_sample(levels=2))  # a coarser truth than shipped, for speed


def _span(landmarks, a, b):
    return np.linalg.norm(np.asarray(landmarks[a]) - landmarks[b])


def test_measurements_follow_the_draw(reference):
    """Over many people the measurements vary by about the published deviations."""
    landmarks = reference.landmark_positions()
    names, at = list(landmarks), np.array(list(landmarks.values()))
    people = []
    for seed in range(60):
        moved = at + draw_field(landmarks, np.random.default_rng(seed))(at)
        people.append(dict(zip(names, moved, strict=True)))
    for a, b, published in (("zy_l", "zy_r", 5.8), ("al_l", "al_r", 2.5), ("ch_l", "ch_r", 3.6), ("n", "sn", 3.8)):
        found = np.std([_span(p, a, b) for p in people])
        assert 0.55 * published < found < 1.3 * published, (a, b, found)


def test_the_field_nowhere_folds(reference):
    points = reference.skin.vertices
    for seed in range(5):
        field = draw_field(reference.landmark_positions(), np.random.default_rng(seed))
        step = 0.01
        slope = np.stack(
            [(field(points + step * e) - field(points - step * e)) / (2 * step) for e in np.eye(3)], axis=2
        )
        assert np.linalg.det(np.eye(3) + slope).min() > 0.3


def test_no_strength_is_the_reference_itself(reference):
    same = individual(reference, np.random.default_rng(1), strength=0.0)
    np.testing.assert_allclose(same.skin.vertices, reference.skin.vertices, atol=1e-9)
    np.testing.assert_allclose(same.muscles[0].fibres, reference.muscles[0].fibres, atol=1e-9)


def test_lids_stay_on_the_eyeballs(reference):
    person = individual(reference, np.random.default_rng(3), strength=1.5)
    for side in "lr":
        before, after = lid_gaps(reference, side), lid_gaps(person, side)
        assert np.abs(after.mean() - before.mean()) < 0.15 and after.min() > -0.05


def test_the_person_differs_from_the_reference_like_people_do(reference, sample):
    a, b = reference.skin.vertices, sample.truth.skin.vertices
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    apart = np.linalg.norm(b - a @ (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt).T, axis=1)
    face = reference.groups["face"] > 0.5
    assert 1.0 < apart[face].mean() < 8.0


def test_the_scan_is_raw(sample):
    mesh, counts = clean_scan(sample.scan)
    assert 70_000 < counts["triangles"] < 140_000
    assert counts["components"] > 10  # sheets and specks
    assert mesh.colour is not None and 0.15 < mesh.colour.mean() < 0.9
    reach = cKDTree(mesh.vertices)
    assert reach.query(sample.landmarks["op"])[0] > 10 and "op" in sample.not_in_scan  # no back of the head
    assert "prn" not in sample.not_in_scan and "ex_l" not in sample.not_in_scan
    throat = sample.landmarks["gn"] + [0, 14, -1]
    assert reach.query(throat)[0] > 3  # a hole under the chin


def test_the_scan_lies_about_the_truth(sample):
    mesh, label = sample.scan, components(sample.scan.triangles, len(sample.scan.vertices))[1]
    sheets = mesh.vertices[np.bincount(label)[label] > 2000]  # without specks
    surface = Surface(sample.surface.vertices, sample.surface.triangles)
    away = np.linalg.norm(sheets - sample.truth.eyes[0].centre, axis=1) > 16
    away &= np.linalg.norm(sheets - sample.truth.eyes[1].centre, axis=1) > 16
    distance = surface.closest(sheets[away][::20]).distance
    assert 0.03 < np.median(distance) < 0.2 and np.percentile(distance, 95) < 0.6
    specks = surface.closest(mesh.vertices[np.bincount(label)[label] < 50]).distance
    assert specks.max() > 5


def test_the_truth_is_exact(sample):
    surface = sample.surface.vertices
    skin = sample.truth.skin
    on_surface = drawn(skin.faces, skin.vertices)
    assert np.linalg.norm(surface[: len(on_surface)] - on_surface, axis=1).max() < 0.5  # but for its unevenness
    on_head = sample.truth.landmarks.on({"skin": on_surface})
    for name, point in sample.landmarks.items():
        assert np.linalg.norm(point - on_head[name]) < 1.5, name
    assert len(sample.landmarks) == 60 and sample.missing == ()


def test_files(sample, tmp_path):
    paths = write_sample(sample, tmp_path / "sample")
    assert [p.name for p in paths] == ["scan.ply", "landmarks.json", "truth.ply"]
    assert sorted(p.name for p in (tmp_path / "sample").iterdir()) == sorted(p.name for p in paths)
    landmarks = read_landmarks(paths[1])
    np.testing.assert_allclose(landmarks["prn"], sample.landmarks["prn"], atol=1e-3)
    assert json.loads(paths[1].read_text())["units"] == "mm"
    assert len(read_ply(paths[0]).triangles) == len(sample.scan.triangles)
    assert len(read_ply(paths[2]).vertices) == len(sample.surface.vertices)


def test_no_folder_can_be_made_in_a_file(sample, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        write_sample(sample, tmp_path / "file")


def test_the_same_seed_gives_the_same_bytes(reference, sample, tmp_path):
    coarse = VirtualScanner(pixel=4.0)
    first, second = (finish(make_sample(7, reference=reference, scanner=coarse, levels=1)) for _ in range(2))
    written = [write_sample(s, tmp_path / str(k)) for k, s in enumerate((first, second))]
    for a, b in zip(*written, strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert np.abs(first.truth.skin.vertices - sample.truth.skin.vertices).max() > 1
