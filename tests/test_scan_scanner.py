# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual scanner measures what both of its eyes see, with errors of the size that was set, and nothing else."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan, components
from headshop.sim.scan.scanner import VirtualScanner

QUIET = VirtualScanner(
    target=(0, 0, 0), field=(220, 220), pixel=2.0, noise=0, ripple=0, quantum=1e-6, registration=0, specks=0
)


def _grid(u, v, place):
    x, y = np.meshgrid(u, v, indexing="ij")
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh.from_triangles(place(x, y).reshape(-1, 3), triangles, colour=np.full((x.size, 3), 0.7, np.float32))


@pytest.fixture(scope="module")
def ball():
    """A ball of 80 mm."""

    def place(a, b):
        return 80 * np.stack([np.cos(b) * np.sin(a), -np.cos(b) * np.cos(a), np.sin(b)], axis=-1)

    return _grid(np.linspace(-np.pi, np.pi, 181), np.linspace(-np.pi / 2, np.pi / 2, 91), place)


def test_without_errors_all_points_lie_on_the_surface(ball):
    scan = finish(QUIET.scan(ball, np.random.default_rng(1)))
    inner = cKDTree(scan.vertices[np.abs(np.linalg.norm(scan.vertices, axis=1) - 80) < 0.1])
    assert inner.n > 0.97 * len(scan.vertices)  # but for mixed pixels on the outline
    normal = np.cross(*(scan.vertices[scan.triangles[:, k]] - scan.vertices[scan.triangles[:, 0]] for k in (1, 2)))
    outward = np.einsum("ij,ij->i", normal, scan.vertices[scan.triangles].mean(axis=1))
    assert (outward > 0).mean() > 0.99


def test_the_back_is_missing(ball):
    scan = finish(QUIET.scan(ball, np.random.default_rng(1)))
    assert scan.vertices[:, 1].min() < -79.5 and scan.vertices[:, 1].max() < 70
    far_back = np.array([[0, 80.0, 0], [0, 60, 50], [0, 0, 80]])
    assert (cKDTree(scan.vertices).query(far_back)[0][:2] > 20).all()


def test_the_noise_is_as_set_and_along_the_ray(ball):
    noisy = VirtualScanner(**{**vars(QUIET), "noise": 0.3, "views": ((0.0, 0.0),)})
    scan = finish(noisy.scan(ball, np.random.default_rng(2)))
    facing = np.hypot(scan.vertices[:, 0], scan.vertices[:, 2]) < 30
    error = np.linalg.norm(scan.vertices[facing], axis=1) - 80
    assert 0.15 < error.std() < 0.5 and abs(error.mean()) < 0.05
    sides = finish(QUIET.scan(ball, np.random.default_rng(2)))
    assert np.std(np.linalg.norm(sides.vertices, axis=1) - 80) < error.std()


def test_what_stands_in_front_throws_a_shadow():
    wall = _grid(np.linspace(-90, 90, 91), np.linspace(-90, 90, 91), lambda x, z: np.stack([x, 0 * x + 40, z], -1))
    bar = _grid(np.linspace(-8, 8, 9), np.linspace(-60, 60, 61), lambda x, z: np.stack([x, 0 * x - 40, z], -1))
    both = Mesh.from_triangles(
        np.concatenate([wall.vertices, bar.vertices]),
        np.concatenate([wall.triangles, bar.triangles + len(wall.vertices)]),
        colour=np.full((len(wall.vertices) + len(bar.vertices), 3), 0.7, np.float32),
    )
    one = VirtualScanner(**{**vars(QUIET), "views": ((0.0, 0.0),), "baseline": 15.0})
    scan = finish(one.scan(both, np.random.default_rng(3)))
    on_wall = scan.vertices[(np.abs(scan.vertices[:, 1] - 40) < 1) & (np.abs(scan.vertices[:, 2]) < 40)]
    x = on_wall[:, 0]
    assert not ((x > -9) & (x < 9)).any()  # the camera cannot see behind the bar
    assert not ((x > -29) & (x < -16)).any()  # its shadow lies 80 mm * tan 15 to the side
    assert ((x > -13) & (x < -9.5)).any() and ((x > 9.5) & (x < 30)).any() and ((x < -34) & (x > -60)).any()


def test_dark_and_mirroring_places_are_not_measured(ball):
    response = np.where(np.linalg.norm(ball.vertices - [0, -80, 0], axis=1) < 25, 0.0, 1.0)
    scan = finish(QUIET.scan(ball, np.random.default_rng(1), response))
    assert cKDTree(scan.vertices).query([0, -80, 0])[0] > 20
    one = VirtualScanner(**{**vars(QUIET), "views": ((0.0, 0.0),), "pixel": 1.0})
    half = np.radians(one.baseline / 2)
    mirror = 80 * np.array([np.sin(half), -np.cos(half), 0])  # between camera and projector
    dull, shiny = (finish(one.scan(ball, np.random.default_rng(1), None, g * np.ones(len(response)))) for g in (0, 1))
    assert cKDTree(dull.vertices).query(mirror)[0] < 0.7
    assert (
        len(cKDTree(shiny.vertices).query_ball_point(mirror, 3))
        < len(cKDTree(dull.vertices).query_ball_point(mirror, 3)) / 2
    )


def test_sheets_overlap_by_a_strip_and_specks_float(ball):
    whole = finish(VirtualScanner(**{**vars(QUIET), "overlap": None}).scan(ball, np.random.default_rng(1)))
    strip = finish(QUIET.scan(ball, np.random.default_rng(1)))
    assert len(strip.triangles) < 0.8 * len(whole.triangles)
    covered = cKDTree(strip.vertices).query(whole.vertices)[0]
    assert np.percentile(covered, 99.5) < 3  # trimming opens no holes
    specks = finish(VirtualScanner(**{**vars(QUIET), "specks": 20.0}).scan(ball, np.random.default_rng(1)))
    pieces, _ = components(specks.triangles, len(specks.vertices))
    assert pieces > components(strip.triangles, len(strip.vertices))[0] + 10
    assert clean_scan(specks)[1]["components"] == pieces


def test_the_same_seed_gives_the_same_bytes(ball):
    device = VirtualScanner(**{**vars(QUIET), "noise": 0.1, "specks": 5.0})
    first, second, other = (finish(device.scan(ball, np.random.default_rng(s))) for s in (4, 4, 5))
    assert first.vertices.tobytes() == second.vertices.tobytes() and first.colour.tobytes() == second.colour.tobytes()
    assert first.vertices.shape != other.vertices.shape or (first.vertices != other.vertices).any()
    assert first.colour.dtype == np.float32 and first.colour.min() >= 0 and first.colour.max() <= 1
