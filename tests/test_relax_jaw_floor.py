# SPDX-License-Identifier: GPL-3.0-or-later
"""An opening jaw presses the flesh under it out, and nothing that pulls on the skin there lets it sink."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, identity

from headshop.sim.mesh import vertex_normals
from headshop.sim.relax.explain import PART, explain, shrinkage
from headshop.sim.relax.jaw_floor import chin, flow, held_up, jaw_surface, pushed_out, under, upright
from headshop.sim.relax.responses import OPENINGS, responses
from headshop.sim.relax.smile import told_of_smile
from headshop.sim.tissue.jaw import jaw_transform


@pytest.fixture(scope="module")
def normals(reference):
    return vertex_normals(reference.skin.vertices, reference.skin.triangles)


@pytest.fixture(scope="module")
def throat(reference, normals):
    """(n,) bool: skin below the jaw between its angles, down to the larynx."""
    up, ahead = upright(reference)
    depth = chin(reference) - reference.skin.vertices @ up
    low = (depth > 4) & (depth < 45)
    front = reference.skin.vertices @ ahead > reference.landmark_positions()["go_l"] @ ahead
    return low & front & (under(reference, normals, chin(reference)) > 0.5)


def outward(field, normals):
    return np.einsum("ij,ij->i", field, normals)


def test_the_surface_of_the_jaw_is_its_hull_without_the_mouths_side(reference):
    points, out, area = jaw_surface(reference)
    up, ahead = upright(reference)
    assert 1000 < len(points) < 10_000 and 2 < area < 8
    assert np.abs(np.linalg.norm(out, axis=1) - 1).max() < 1e-6 and (out @ up).max() < 0.5
    lowest = points[(points @ up).argsort()[:50]]
    assert (lowest @ up).min() == pytest.approx((reference.parts["mandible"].vertices @ up).min(), abs=1)
    # As much of it looks to either side, and it bulges from its middle.
    assert (
        abs(out.mean(axis=0)[0]) < 0.02 and (np.einsum("ij,ij->i", points - points.mean(axis=0), out) > 0).mean() > 0.9
    )


def test_flesh_flows_out_under_an_opening_jaw_and_is_not_lost(reference, normals, throat):
    points, out, area = jaw_surface(reference)
    triangles = reference.skin.triangles
    corners = reference.skin.vertices[triangles]
    size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    share = np.bincount(triangles.ravel(), np.repeat(size, 3), len(normals)) * (reference.groups["inner"] < 0.5)
    before = 0
    for opening in OPENINGS:
        turn, shift = jaw_transform(reference.jaw, opening)
        swept = outward(points @ turn.T + shift - points, out).sum() * area
        moved = flow(reference, normals, opening)
        assert swept < moved @ share < 2.05 * swept
        assert before < moved[throat].mean() and (moved[throat] > 0).all()
        before = moved[throat].mean()
    assert np.abs(flow(reference, normals, 0.0)).max() < 1e-9


def test_the_skin_goes_as_far_out_as_the_flesh_but_in_front_of_the_jaw(reference, normals, throat):
    moved = flow(reference, normals, 0.2)
    sunk = pushed_out(reference, -normals, 0.2)
    assert np.all(outward(sunk, normals)[throat] > moved[throat] * 0.5 - 0.5)
    assert outward(sunk, normals)[throat].mean() > 0.85 * moved[throat].mean()
    marks = reference.landmark_positions()
    still = np.linalg.norm(reference.skin.vertices - marks["pg"], axis=1) < 6
    still |= reference.skin.vertices @ upright(reference)[0] > marks["sto"] @ upright(reference)[0]
    assert still.sum() > 500 and np.array_equal(sunk[still], -normals[still])
    far = pushed_out(reference, 40 * normals, 0.2)
    assert np.array_equal(far, 40 * normals)


def test_skin_under_the_jaw_does_not_sink(reference, normals, throat):
    held = held_up(reference, -normals)
    assert np.abs(outward(held, normals)[throat]).max() < 0.5 and np.abs(outward(held, normals)[throat]).mean() < 0.1
    assert np.array_equal(held_up(reference, normals), normals)
    above = reference.skin.vertices @ upright(reference)[0] > chin(reference) + 8
    assert np.array_equal(held[above], -normals[above])


def test_the_table_of_responses_has_the_bulge(reference, normals, throat):
    table = responses()
    for k, opening in enumerate(OPENINGS):
        lacks = flow(reference, normals, opening) - outward(table.jaw[k], normals)
        assert np.percentile(lacks[throat], 90) < 0.1
    for name in ("zygomaticus_major_l", "mentalis_l", "platysma_l"):
        assert outward(table.fields[table.names.index(name)], normals)[throat].min() > -0.5


def test_a_smiling_jaw_opens_with_the_smile(reference):
    names = responses().names
    plain, smiling = shrinkage(names), shrinkage(names, smiles=True)
    assert np.array_equal(plain[1:], smiling[1:]) and plain[0, -1] == 0
    assert smiling[0, 0] == pytest.approx(1 / PART) and smiling[0, -1] < 0
    # Offsets that say little of how far the jaw is open: known of a smile, it is taken for less so.
    table, vertices = responses(), reference.skin.vertices
    rows = np.linalg.norm(vertices - reference.landmark_positions()["pg"], axis=1).argmin()
    sampling = csr_matrix(([1.0], ([0], [rows])), shape=(1, len(vertices)))
    offsets = sampling @ table.jaw_at(0.4)
    lip = np.linalg.norm(vertices - reference.landmark_positions()["sto"], axis=1).argmin()
    told = told_of_smile(reference, table, identity(len(vertices), format="csr"), lip, 0.2)
    assert told.smiles
    given = (table, vertices, reference.jaw, sampling, offsets, 16 * np.eye(3), 1.0)
    assert explain(*given, told=told).jaw < 0.8 * explain(*given).jaw
