# SPDX-License-Identifier: GPL-3.0-or-later
"""The bones of the reference head: at their depth, inside the skin, closed, symmetric, hinged."""

import numpy as np
import pytest

from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.landmark_names import SKULL, mirrored
from headshop.sim.anatomy.storage import load_head
from headshop.sim.anatomy.tissue_depth import depths, skin_counterparts, skull_targets, tissue_vectors
from headshop.sim.mesh import Mesh

CUBE = Mesh(
    np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float),
    np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)], np.int32),
)


@pytest.fixture(scope="module")
def head():
    return load_head()


def closed_and_even(mesh):
    """Whether every edge has two faces that run it in opposite directions, and the volume is positive."""
    t = mesh.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    forth = np.unique(directed, axis=0)
    back = np.unique(directed[:, ::-1], axis=0)
    corner = mesh.vertices[t] - mesh.vertices.mean(axis=0)
    volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2]))
    return len(forth) == len(directed) and np.array_equal(forth, back) and volume > 0


def off_mirror(mesh):
    """Largest distance, mm, from a vertex's mirror image to the nearest vertex."""
    from scipy.spatial import cKDTree

    return cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])[0].max()


def test_winding_number_of_a_cube():
    points = np.array([(0.5, 0.5, 0.5), (0.1, 0.9, 0.2), (1.5, 0.5, 0.5), (-3, 2, 9)])
    found = winding_number(points, CUBE.vertices, CUBE.triangles)
    np.testing.assert_allclose(found, [1, 1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(winding_number(points, CUBE.vertices, CUBE.triangles, budget=7), found, atol=1e-12)
    flipped = winding_number(points, CUBE.vertices, CUBE.triangles[:, ::-1])
    np.testing.assert_allclose(flipped, -found, atol=1e-9)


def test_winding_number_forgives_a_hole():
    open_cube = CUBE.triangles[:-2]
    assert inside([(0.3, 0.5, 0.5)], CUBE.vertices, open_cube)[0]
    assert not inside([(1.7, 0.5, 0.5)], CUBE.vertices, open_cube)[0]


def test_depth_table_names_all_skull_landmarks():
    assert set(depths()) == set(SKULL)
    assert all(2 < d.mean < 20 and 0 < d.sd < d.mean for d in depths().values())


def test_tissue_depth_at_the_landmarks(head):
    skin, bone = skin_counterparts(head.landmark_positions()), head.skull_landmark_positions()
    # The bridge of the nose is no landmark: the skin itself is its counterpart.
    skin["rhi"] = head.skin.vertices[np.linalg.norm(head.skin.vertices - bone["rhi"], axis=1).argmin()]
    off = {n: abs(np.linalg.norm(skin[n] - bone[n]) - d.mean) / d.sd for n, d in depths().items()}
    assert max(off.values()) < 1, off


def test_skull_landmarks_are_pairs(head):
    bone = head.skull_landmark_positions()
    for name, at in bone.items():
        np.testing.assert_allclose(bone[mirrored(name)] * [-1, 1, 1], at, atol=0.3)


@pytest.mark.parametrize("part", ["skull", "mandible"])
def test_bones_lie_in_the_flesh(head, part):
    bone = head.parts[part].vertices
    assert inside(bone, head.skin.vertices, head.skin.triangles).all()
    # At least 1 mm under the skin one sees.
    from scipy.spatial import cKDTree

    seen = head.groups["inner"][head.skin.triangles].max(axis=1) < 0.5
    corner = head.skin.vertices[head.skin.triangles[seen]]
    weights = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8
    samples = np.einsum("wk,tkd->twd", weights, corner).reshape(-1, 3)
    assert cKDTree(samples).query(bone)[0].min() > 1.0


def test_mandible_does_not_cut_the_skull(head):
    skull, mandible = head.parts["skull"], head.parts["mandible"]
    assert not inside(mandible.vertices, skull.vertices, skull.triangles).any()
    assert not inside(skull.vertices, mandible.vertices, mandible.triangles).any()


@pytest.mark.parametrize("part", ["skull", "mandible"])
def test_bones_are_closed_symmetric_quads(head, part):
    mesh = head.parts[part]
    assert closed_and_even(mesh)
    assert off_mirror(mesh) < 0.02
    assert (mesh.faces[:, 3] >= 0).mean() > 0.9
    assert 500 < len(mesh.vertices) < 7000


def test_skull_has_orbits_and_a_nose(head):
    """Points in the middle of either orbit and of the nasal aperture are free, the bone round them is not."""
    skull, skin = head.parts["skull"], head.landmark_positions()
    bone = head.skull_landmark_positions()
    left, right = (eye.centre for eye in head.eyes)
    aperture = 0.35 * bone["rhi"] + 0.65 * bone["ans"] + [0, 10, 0]
    free = np.array([left, right, left + [0, 12, 0], aperture])
    assert not inside(free, skull.vertices, skull.triangles).any()
    solid = np.array(
        [bone["g"] + [0, 4, 0], bone["zy_l"] + [-2.5, 0, 0], bone["or_l"] + [0, 4, -4], skin["v"] - [0, 0, 20]]
    )
    assert inside(solid, skull.vertices, skull.triangles).all()


def test_zygomatic_arch_is_free(head):
    """Between arch and temple there is room for the temporal muscle and the coronoid process."""
    skull, bone = head.parts["skull"], head.skull_landmark_positions()
    gap = bone["zy_l"] + np.outer(np.arange(8, 16), [-1.0, 0, 0]) + [0, -10, 0]
    assert (~inside(gap, skull.vertices, skull.triangles)).sum() >= 5


def turned(points, jaw, angle, slide):
    """The mandible's motion: a turn about the hinge and a slide of the condyles forward and down."""
    middle = (jaw.condyle_l + jaw.condyle_r) / 2
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return (points - middle) @ turn.T + middle + slide * np.array([0, -0.8, -0.6])


def test_jaw_opens_in_its_joint(head):
    jaw, mandible, skull = head.jaw, head.parts["mandible"], head.parts["skull"]
    np.testing.assert_allclose(jaw.condyle_l * [-1, 1, 1], jaw.condyle_r, atol=1e-6)
    assert inside([jaw.condyle_l, jaw.condyle_r], mandible.vertices, mandible.triangles).all()
    assert 0.2 < jaw.open_max < 0.7
    sign = 1 if turned(jaw.incisor, jaw, 0.1, 0)[2] < jaw.incisor[2] else -1
    opened = turned(mandible.vertices, jaw, sign * jaw.open_max, jaw.slide_max)
    incisor = turned(jaw.incisor, jaw, sign * jaw.open_max, jaw.slide_max)
    assert 35 < np.linalg.norm(incisor - jaw.incisor) < 65
    assert incisor[2] < jaw.incisor[2] - 30
    np.testing.assert_allclose(opened[:, 0], mandible.vertices[:, 0], atol=1e-9)
    deep = inside(opened, skull.vertices, skull.triangles)
    assert deep.mean() < 0.02  # the condyle may brush the eminence it slides along


def test_thicker_tissue_moves_bone_inward(head):
    skin, bone = head.landmark_positions(), head.skull_landmark_positions()
    vectors = tissue_vectors(skin, bone)
    assert set(vectors) == set(SKULL)
    same, thick, chin = (skull_targets(skin, vectors, s) for s in (1.0, 1.5, {"pg": 2.0}))
    for name in SKULL:
        np.testing.assert_allclose(same[name], bone[name], atol=1e-9)
        np.testing.assert_allclose(thick[name], bone[name] - 0.5 * vectors[name], atol=1e-9)
    np.testing.assert_allclose(chin["pg"], bone["pg"] - vectors["pg"], atol=1e-9)
    np.testing.assert_allclose(chin["g"], bone["g"], atol=1e-9)
