# SPDX-License-Identifier: GPL-3.0-or-later
"""Warps with sites that slide: against Gaussian conditioning done by hand, and on people whose skin is known."""

from itertools import chain, repeat

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.spatial.distance import cdist

from headshop.sim.adapt import fine_fit, sliding_warp, thin_plate_spline
from headshop.sim.adapt.openings import lid_margins, opening, rims, unlike
from headshop.sim.adapt.scan_surface import scan_surface
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.adapt.sliding import framed, spread_sites
from headshop.sim.adapt.sliding_warp import Mirror, SlidingWarp
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.scan.individual import draw_field


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.fixture
def observed():
    """Arguments of `SlidingWarp.fit`: 9 landmarks and 14 sites."""
    rng = np.random.default_rng(5)
    marks, sites = rng.normal(0, 60, (9, 3)), rng.normal(0, 60, (14, 3))
    goals, places = (x @ (np.eye(3) + rng.normal(0, 0.05, (3, 3))) + rng.normal(0, 4, x.shape) for x in (marks, sites))
    frames = framed(unit(rng.normal(size=(9, 3))))
    noise, slack = rng.uniform(0.2, 3, (9, 3)), rng.uniform(0.3, 2, 14)
    return marks, goals, frames, noise, sites, places, unit(rng.normal(size=(14, 3))), slack


def test_frames_are_turns_that_end_on_the_normal():
    normals = np.concatenate([np.eye(3), -np.eye(3), unit(np.random.default_rng(1).normal(size=(5, 3)))])
    frames = framed(normals)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(normals), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(frames[:, 2], normals)


@pytest.mark.parametrize("alike", [0.0, sliding_warp.ALIKE])
def test_equals_the_mean_of_a_gaussian_process(observed, alike):
    marks, goals, frames, noise, sites, places, normals, slack = observed
    points = np.random.default_rng(6).normal(0, 70, (5, 3))
    # One scalar observation after the other, the trend a random field too, of a variance without bounds.
    at, way, seen, deviation = [], [], [], []
    for k in range(len(marks)):
        for axis in range(3):
            at.append(marks[k])
            way.append(frames[k, axis])
            seen.append((goals[k] - marks[k]) @ frames[k, axis])
            deviation.append(noise[k, axis])
    for k in range(len(sites)):
        at.append(sites[k])
        way.append(normals[k])
        seen.append((places[k] - sites[k]) @ normals[k])
        deviation.append(slack[k])
    at, way = np.array(at), np.array(way)

    def field(a, b):
        """Covariance of one component: Matérn's with 3/2, and what is linear in the place, in units of 100 mm."""
        far = np.sqrt(3) * cdist(a, b) / sliding_warp.TOGETHER
        linear = 1 + a @ b.T / 100**2
        return sliding_warp.AMPLITUDE**2 * (1 + far) * np.exp(-far) + 1e7 * linear

    def both(a, b):
        """(k, 3, m, 3) covariance of all components: with what a place shares with its mirror image."""
        turn = np.eye(3) - 2 * np.outer(mirror.normal, mirror.normal)
        image = mirror.point + (b - mirror.point) @ turn
        far = np.sqrt(3) * cdist(a, image) / sliding_warp.TOGETHER
        shared = alike * sliding_warp.AMPLITUDE**2 * (1 + far) * np.exp(-far)
        return np.einsum("km,xy->kxmy", field(a, b), np.eye(3)) + np.einsum("km,xy->kxmy", shared, turn)

    mirror = Mirror(np.array([3.0, -20.0, 8.0]), unit(np.array([[0.9, 0.1, -0.2]]))[0])
    gram = np.einsum("kx,kxmy,my->km", way, both(at, at), way) + np.diag(np.square(deviation))
    strength = np.linalg.solve(gram, np.array(seen))
    expected = points + np.einsum("kxmy,my,m->kx", both(points, at), way, strength)
    warp = SlidingWarp.fit(*observed, mirror if alike else None)
    np.testing.assert_allclose(warp.transform(points), expected, atol=2e-3)


def test_one_side_tells_of_the_other():
    """A bump on one side is taken to be on the other too."""
    side = np.array([[60.0, y, z] for y in (-50, 0, 50) for z in (-50, 0, 50)])
    middle = side * [0, 1, 1]
    marks, top = np.concatenate([side, middle]), 4  # the one of ``side`` in the middle
    goals = marks + 6.0 * (np.arange(len(marks)) == top)[:, None] * [1, 0, 0]
    frames, noise = np.tile(np.eye(3), (len(marks), 1, 1)), np.full(marks.shape, 0.3)
    nothing = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
    other = side * [-1, 1, 1]

    def moved(mirror):
        return SlidingWarp.fit(marks, goals, frames, noise, *nothing, mirror).transform(other) - other

    alone, together = moved(None), moved(Mirror(np.zeros(3), np.array([1.0, 0, 0])))
    rise = (together - alone) @ [-1, 0, 0]
    assert rise.argmax() == top and 3.0 < rise[top] < 6.0


def test_a_site_slides_along_the_surface_and_holds_across_it(observed):
    marks, goals, frames, noise, sites, places, normals, slack = observed
    along = 5 * framed(normals)[:, 0]
    slid = SlidingWarp.fit(marks, goals, frames, noise, sites, places + along, normals, slack)
    raised = SlidingWarp.fit(marks, goals, frames, noise, sites, places + 5 * normals, normals, np.full(14, 0.01))
    first = SlidingWarp.fit(*observed)
    np.testing.assert_allclose(slid.transform(sites), first.transform(sites), atol=1e-8)
    miss = np.einsum("ij,ij->i", raised.transform(sites) - places - 5 * normals, normals)
    assert np.abs(miss).max() < 0.05


def test_an_affine_map_is_reproduced_in_small_tables(observed, monkeypatch):
    marks, _, frames, noise, sites, _, normals, slack = observed
    matrix, points = (
        np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.3], [0.05, 0.0, 1.2]]),
        np.random.default_rng(2).normal(size=(99, 3)),
    )

    def carried(x):
        return x @ matrix.T + 7

    warp = SlidingWarp.fit(marks, carried(marks), frames, noise, sites, carried(sites), normals, slack)
    monkeypatch.setattr(thin_plate_spline, "BLOCK", 60)
    np.testing.assert_allclose(warp.transform(points), carried(points), atol=1e-8)


def test_sites_are_spread_closer_together_in_the_face(reference):
    skin, face = reference.skin.vertices, reference.groups["face"] > 0.5
    outer = reference.skin.triangles[~(reference.groups["inner"] > 0.5)[reference.skin.triangles].any(axis=1)]
    sites = spread_sites(skin, outer, face)
    assert len(np.unique(sites)) == len(sites) and np.isin(sites, outer).all()
    near = np.sort(cdist(skin[sites], skin[sites]), axis=1)[:, 1]
    assert np.median(near[face[sites]]) < 0.8 * np.median(near[~face[sites]])


@pytest.mark.parametrize("seed", [3, 4])
def test_skin_finds_the_points_it_belongs_to(reference, seed):
    """Not only the surface: between landmarks the skin must not slide on it."""
    skin = reference.skin
    cage = skin.vertices + draw_field(reference.landmark_positions(), np.random.default_rng(seed))(skin.vertices)
    operator, quads = smoother(skin.faces, len(cage), 1)
    inner = np.asarray(reference.groups["inner"]) > 0.5
    points = operator @ cage
    hidden = np.append(
        np.flatnonzero(inner), np.flatnonzero((operator @ inner.astype(float))[len(cage) :] > 0.3) + len(cage)
    )
    triangles = Mesh(points, quads).triangles
    scan = Mesh.from_triangles(points, triangles[~np.isin(triangles, hidden).any(axis=1)])
    landmarks = reference.landmarks.on({"skin": points[: len(cage)]})
    landmarks = {name: landmarks[name] for name in reference.landmarks.names if name in landmarks}
    fit = finish(fit_skin(reference, scan_surface(reference, scan, landmarks), landmarks))
    face = (np.asarray(reference.groups["face"]) > 0.5) & ~inner
    off = np.linalg.norm(fit.fitted.vertices - points[: len(cage)], axis=1)[face]
    assert off.mean() < 0.45


def test_margins_of_lids_tell_how_unlike_the_eye_is(reference):
    rest = reference.landmark_positions()
    rim = rims(reference)
    for share, expected in ((1.0, 0.0), (np.sqrt(0.5), 0.5), (0.4, 1.0), (2.5, 1.0)):
        given = dict(rest)
        for side in "lr":
            middle = (rest[f"ps_{side}"] + rest[f"pi_{side}"]) / 2
            for name in (f"ps_{side}", f"pi_{side}"):
                given[name] = middle + share * (rest[name] - middle)
        np.testing.assert_allclose([unlike(rest, given, side) for side in "lr"], expected, atol=1e-9)
        change = lid_margins(reference, rim, given, np.eye(3))[2]
        np.testing.assert_allclose(change, expected, atol=1e-9)
    assert (lid_margins(reference, rim, dict(rest), np.eye(3), ("l", "r"))[2] == 1).all()
    assert opening(rest, "l") == pytest.approx(opening(rest, "r"), rel=0.05)
    assert unlike(rest, {k: v for k, v in rest.items() if k != "ps_l"}, "l") == 1


def rounds_of(reference):
    """The generator of the last stage, for the reference on the surface drawn of it."""
    skin = reference.skin
    n = len(skin.vertices)
    free = ~(np.asarray(reference.groups["inner"]) > 0.5)
    rows, quads = smoother(skin.faces, n, 2)
    surface = scan_surface(reference, Mesh(rows @ skin.vertices, quads), {})
    none = fine_fit.Anchors(csr_matrix(([1.0], ([0], [0])), shape=(1, n)), np.zeros((1, 3)), np.ones(1))
    return fine_fit.fine_fit(skin.vertices, skin.faces, free, np.zeros(n, dtype=bool), surface, none)


FAR = (fine_fit.AT_ONCE + fine_fit.BEGUN) / 2
#: How far the skin is off before the first round and before all others, and how many more rounds than in the schedule it takes.
OFFS = (
    (0.0, 0.0, -4),
    (fine_fit.AT_ONCE, fine_fit.AT_ONCE, -4),
    (fine_fit.AT_ONCE, FAR, fine_fit.AGAIN - 4),
    (FAR, 0.0, -3),
    (FAR, (fine_fit.NEAR + fine_fit.LEFT) / 2, -2),
    (fine_fit.BEGUN, fine_fit.BEGUN, fine_fit.AGAIN - 2),
    (1.0, 0.0, -1),
    (1.0, 1.0, fine_fit.AGAIN),
)


@pytest.mark.parametrize("first, then, more", OFFS)
def test_there_are_as_many_rounds_as_the_skin_is_off_the_data(reference, monkeypatch, first, then, more):
    offs = chain([first], repeat(then))
    monkeypatch.setattr(fine_fit, "nearer", lambda base, moved, *rest: (moved, next(offs)))
    assert len(list(rounds_of(reference))) == len(fine_fit.SCHEDULE) + more


@pytest.mark.parametrize("first, soft", [(0.0, [5]), (FAR, [3, 5])])
def test_a_skin_that_is_near_takes_a_single_stiff_round_and_the_last_soft_one_at_once(
    reference, monkeypatch, first, soft
):
    solve, nearer, taken, offs = fine_fit.solve_displacement, fine_fit.nearer, [], iter([first])

    def noted(smooth, soft, *rest):
        taken.append(soft)
        return solve(smooth, soft, *rest)

    def as_if(*arguments):
        moved, off = nearer(*arguments)
        return moved, next(offs, off)

    monkeypatch.setattr(fine_fit, "solve_displacement", noted)
    monkeypatch.setattr(fine_fit, "nearer", as_if)
    list(rounds_of(reference))
    assert taken == [fine_fit.STIFF] + [fine_fit.SCHEDULE[k][0] for k in soft]
