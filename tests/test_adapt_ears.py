# SPDX-License-Identifier: GPL-3.0-or-later
"""Ears of which a scan shows the front alone."""

import numpy as np
import pytest

from headshop.sim.adapt import skin_fit
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.ears import ear_sheets
from headshop.sim.mesh import vertex_normals
from headshop.sim.mesh_subdivision import drawn, subdivision
from headshop.sim.progress import finish

STANDING_OFF = 6.0  # mm forward at the helix


@pytest.fixture(scope="module")
def reference_drawn(reference):
    skin = reference.skin
    return reference.with_vertices({"skin": drawn(skin.faces, skin.vertices)})


@pytest.fixture(scope="module")
def front_only(reference):
    """A scan of ears that stand off farther than the reference's, seen from the front; and landmarks, a few of them on ears."""
    skin, groups = reference.skin, reference.groups
    outer = ~(np.asarray(groups["inner"]) > 0.5)[skin.faces].any(axis=1)
    grow, quads, _ = subdivision(skin.faces[outer], len(skin.vertices), 2)
    points = grow @ skin.vertices
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    ear = grow @ np.maximum(*(np.asarray(groups[f"ear_{side}"], dtype=float) for side in "lr"))
    back = (ear > 0.2) & (vertex_normals(points, triangles)[:, 1] > 0.2)
    points[:, 1] -= STANDING_OFF * np.clip((np.abs(points[:, 0]) - 72) / 12, 0, 1) * (ear > 0.1)
    given = {n: p for n, p in reference.landmark_positions().items() if n[:-2] not in ("sa", "sba", "pa")}
    return Surface(points, triangles[~back[triangles].any(axis=1)], smooth=2.0), given


def test_sheets_join_the_front_of_ears_to_their_back(reference_drawn):
    skin = reference_drawn.skin
    a, b = ear_sheets(reference_drawn).T
    normal = vertex_normals(skin.vertices, skin.triangles)
    assert len(a) > 100 and len(set(zip(a, b, strict=True))) == len(a)
    assert (np.einsum("ij,ij->i", normal[a], normal[b]) < -0.2).all()
    assert (np.linalg.norm(skin.vertices[a] - skin.vertices[b], axis=1) < 10.0).all()
    assert (np.sign(skin.vertices[a, 0]) == np.sign(skin.vertices[b, 0])).all()
    assert abs((skin.vertices[a, 0] > 0).sum() - len(a) / 2) <= 2  # as many on either side


def test_an_ear_whose_front_was_scanned_stays_as_thick_as_it_is(reference, reference_drawn, front_only):
    target, given = front_only
    a, b = ear_sheets(reference_drawn).T
    before = reference_drawn.skin.vertices
    fit = finish(skin_fit.fit_skin(reference, target, given))
    after = fit.fitted.vertices
    share = np.linalg.norm(after[a] - after[b], axis=1) / np.linalg.norm(before[a] - before[b], axis=1)
    assert 0.92 < share.mean() < 1.05 and np.percentile(share, 5) > 0.68  # .86 and .56 without a tie
    ear = np.unique(np.concatenate([a, b]))
    distance = fit.fitted.distance[ear]
    assert np.nanmean(np.abs(distance)) < 0.2 and np.isfinite(distance).mean() > 0.3
