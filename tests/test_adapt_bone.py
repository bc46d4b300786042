# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone gives way to the skin over it: everywhere as deep as asked, smoothly, and no farther than it must."""

import numpy as np
import pytest

from headshop.sim.adapt.bone import least_depth
from headshop.sim.adapt.bone_inside import keep_inside
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.skin_cover import SkinCover
from headshop.sim.adapt.smooth_system import laplacian
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import drawn


def ball(radius, parts):
    """A cube of 6 parts² quads blown up to a sphere of ``radius`` mm."""
    line = np.linspace(-1, 1, parts + 1)
    u, v = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    one = np.ones(len(u))
    sides = [(one, u, v), (-one, v, u), (v, one, u), (u, -one, v), (u, v, one), (v, u, -one)]
    points = np.concatenate([np.stack(side, axis=1) for side in sides])
    k = np.arange((parts + 1) ** 2).reshape(parts + 1, parts + 1)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    quads = np.concatenate([quads + side * len(u) for side in range(6)])
    points, index = np.unique(np.round(points, 9) + 0.0, axis=0, return_inverse=True)
    points = np.tan(points * np.pi / 4)
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    return Mesh(points, index.reshape(-1)[quads].astype(np.int32))


@pytest.fixture(scope="module")
def skin():
    """A coarse ball of skin, 60 mm, with a dent 3.6 mm deep."""
    mesh = ball(60.0, 9)
    dent = np.exp(-(((mesh.vertices - [0, -60, 0]) ** 2).sum(axis=1)) / (2 * 12.0**2))
    return mesh.moved(mesh.vertices * (1 - 3.6 / 60 * dent)[:, None])


def gaps(bone, vertices, triangles):
    """Least distance, mm, from bone to skin and from skin to bone; corners, and the middles of triangles and sides."""

    def spots(v, t):
        pairs = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        return np.concatenate([v, v[t].mean(axis=1), v[pairs].mean(axis=1)])

    there = Surface(vertices, triangles).closest(spots(bone.vertices, bone.triangles)).distance
    back = Surface(bone.vertices, bone.triangles).closest(spots(vertices, triangles)).distance
    return there.min(), back.min()


@pytest.mark.parametrize("parts", [6, 22])
def test_bone_gets_as_deep_as_asked_under_cage_and_drawn_skin(skin, parts):
    """Whether its faces are larger than the skin's or smaller."""
    bone = ball(56.0, parts)
    cover = SkinCover(skin, np.zeros(len(skin.vertices)), 0.4)
    moved = bone.moved(keep_inside(bone, cover, np.full(len(bone.vertices), 1.5)))
    limit = drawn(skin.faces, skin.vertices)
    assert min(gaps(bone, limit, skin.triangles)) < 0.8
    for vertices in (skin.vertices, limit):
        assert min(gaps(moved, vertices, skin.triangles)) > 1.2
    # Smoothly, and only where it must.
    step = moved.vertices - bone.vertices
    far = np.linalg.norm(bone.vertices - [0, -56, 0], axis=1) > 90
    assert np.linalg.norm(step[far], axis=1).max() < 0.05
    if parts < 12:
        return
    rough = np.linalg.norm(laplacian(bone.vertices, bone.faces) @ step, axis=1).max()
    assert rough < 0.5 * np.linalg.norm(step, axis=1).max() < 3


def test_bone_that_lies_deep_stays(skin):
    bone = ball(52.0, 8)
    cover = SkinCover(skin, np.zeros(len(skin.vertices)), 0.4)
    np.testing.assert_array_equal(keep_inside(bone, cover, np.full(len(bone.vertices), 1.5)), bone.vertices)
    deep = ball(20.0, 4)
    np.testing.assert_array_equal(keep_inside(deep, cover, np.full(len(deep.vertices), 1.5)), deep.vertices)


def test_bone_outside_comes_back(skin):
    bone = ball(56.0, 14)
    out = bone.vertices.copy()
    out[np.argmin(bone.vertices[:, 2])] *= 1.1
    cover = SkinCover(skin, np.zeros(len(skin.vertices)), 0.4)
    moved = bone.moved(keep_inside(bone.moved(out), cover, np.full(len(out), 1.5)))
    assert (cover.depth(moved.vertices) > 1.3).all()
    assert np.linalg.norm(moved.vertices, axis=1).max() < 59


def test_a_lining_wants_less_than_the_skin_one_sees(skin):
    bone = ball(56.0, 22)
    least = np.full(len(bone.vertices), 1.5)
    inner = (skin.vertices[:, 1] < -30).astype(float)
    lined = bone.moved(keep_inside(bone, SkinCover(skin, inner, 0.3), least))
    seen = bone.moved(keep_inside(bone, SkinCover(skin, 0 * inner, 0.3), least))
    assert 0.2 < min(gaps(lined, skin.vertices, skin.triangles)) < 1.0
    assert np.linalg.norm(lined.vertices - bone.vertices) < np.linalg.norm(seen.vertices - bone.vertices)


def test_no_bone_needs_more_than_the_reference_has():
    deep = np.array([0.2, 1.3, 2.0, 10.0])
    needs = least_depth(deep)
    assert (needs >= 1.1).all() and (needs[1:] < deep[1:]).all() and (np.diff(needs) >= 0).all()
