# SPDX-License-Identifier: GPL-3.0-or-later
"""Packing UVs moves whole islands into the square and changes nothing about them but place, turn and size."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh

pytest.importorskip("xatlas", reason="xatlas is not installed")


@pytest.fixture
def atlas(blender):
    from headshop.headshop_addon import atlas

    return atlas


def _two_squares() -> Mesh:
    """Two quads and a triangle far apart in UV space, all of size 0.1 but the second, twice as large."""
    faces = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, -1]], dtype=np.int32)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 0.1
    uv = np.stack([square, square * 2 + 3, square + 7]).astype(np.float32)
    return Mesh(np.zeros((11, 3)), faces, uv=uv)


def _edges(uv):
    return np.linalg.norm(uv - np.roll(uv, 1, axis=1), axis=2)


def test_islands_keep_their_shape_and_fit_the_square(atlas):
    mesh = _two_squares()
    uv, share = atlas.packed(mesh, resolution=512)
    assert 0 < share <= 1
    used = uv[mesh.faces >= 0]
    assert used.min() >= 0 and used.max() <= 1
    before, after = _edges(mesh.uv[:2]), _edges(uv[:2])
    ratio = after / before
    assert ratio == pytest.approx(ratio[0, 0], rel=0.02), "one scale for all islands"
    boxes = [(u.min(axis=0), u.max(axis=0)) for u in (uv[0], uv[1], uv[2, :3])]
    for i in range(3):
        for j in range(i):
            (a, b), (c, d) = boxes[i], boxes[j]
            assert (b <= c).any() or (d <= a).any(), "islands overlap"


def test_without_uvs_the_artist_is_told(atlas):
    with pytest.raises(InputError, match="unwrap"):
        atlas.packed(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2, -1]], np.int32)))


def test_a_head_gets_a_layer_of_its_own(addon, reference):
    from headshop.headshop_addon import bridge, heads

    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    before = bridge.object_to_mesh(skin).uv.copy()
    addon.ops.headshop.repack_uv(resolution=1024)
    layers = skin.data.uv_layers
    assert [layer.name for layer in layers] == ["UVMap", "Atlas"] and layers.active.name == "Atlas"
    packed = bridge.object_to_mesh(skin).uv
    assert packed.min() >= 0 and packed.max() <= 1 and not np.allclose(packed, before)
    layers.active = layers["UVMap"]
    assert np.array_equal(bridge.object_to_mesh(skin).uv, before)
