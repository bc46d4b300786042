# SPDX-License-Identifier: GPL-3.0-or-later
"""The bones of the reference head: at their depth, inside the skin, closed, symmetric, hinged."""

import numpy as np
import pytest

from headshop.assets.generators.teeth_places import tooth_places
from headshop.sim.adapt.bone import depth_under
from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.landmark_names import SKULL, mirrored
from headshop.sim.anatomy.storage import load_head
from headshop.sim.anatomy.teeth import crowns
from headshop.sim.anatomy.tissue_depth import depths, skin_counterparts, skull_targets, tissue_vectors
from headshop.sim.health.topology import closed, volume
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_piercing import piercings
from headshop.sim.tissue.jaw import jaw_transform, opening_mm

CUBE = Mesh(
    np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float),
    np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)], np.int32),
)


@pytest.fixture(scope="module")
def head():
    return load_head()


def test_bones_are_light(head):
    assert len(head.parts["skull"].vertices) + len(head.parts["mandible"].vertices) < 8000


def off_mirror(mesh):
    """Largest distance, mm, from a vertex's mirror image to the nearest vertex."""
    from scipy.spatial import cKDTree

    return cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])[0].max()


def mirrored_faces(mesh):
    """Whether the mirror image has the same triangles, so that both halves shade alike."""
    from scipy.spatial import cKDTree

    twin = cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])[1]
    here = np.unique(np.sort(mesh.triangles, axis=1), axis=0)
    there = np.unique(np.sort(twin[mesh.triangles], axis=1), axis=0)
    return np.array_equal(here, there)


def test_winding_number_of_a_cube():
    points = np.array([(0.5, 0.5, 0.5), (0.1, 0.9, 0.2), (1.5, 0.5, 0.5), (-3, 2, 9)])
    found = winding_number(points, CUBE.vertices, CUBE.triangles)
    np.testing.assert_allclose(found, [1, 1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(winding_number(points, CUBE.vertices, CUBE.triangles, budget=7), found, atol=1e-12)
    flipped = winding_number(points, CUBE.vertices, CUBE.triangles[:, ::-1])
    np.testing.assert_allclose(flipped, -found, atol=1e-9)


def test_far_triangles_counted_in_groups_give_the_same_answer(head):
    mesh = head.skin  # open below
    some = np.random.default_rng(3)
    points = np.concatenate(
        [
            some.uniform(mesh.vertices.min(axis=0) - 15, mesh.vertices.max(axis=0) + 5, (900, 3)),
            mesh.vertices[::40] + some.normal(0, 1.0, mesh.vertices[::40].shape),
        ]
    )
    exact = winding_number(points, mesh.vertices, mesh.triangles)
    assert (np.abs(exact - 0.5) < 0.3).any(), "some are hard to tell"
    np.testing.assert_array_equal(inside(points, mesh.vertices, mesh.triangles), exact > 0.5)


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
    assert closed(mesh) and volume(mesh) > 0
    assert off_mirror(mesh) < 1e-6
    assert mirrored_faces(mesh)
    assert (mesh.faces[:, 3] >= 0).mean() > 0.9
    assert 500 < len(mesh.vertices) < 6000


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


def test_jaw_opens_in_its_joint(head):
    jaw, mandible = head.jaw, head.parts["mandible"]
    np.testing.assert_allclose(jaw.condyle_l * [-1, 1, 1], jaw.condyle_r, atol=1e-6)
    assert inside([jaw.condyle_l, jaw.condyle_r], mandible.vertices, mandible.triangles).all()
    assert 45 < opening_mm(jaw, 1.0) < 50
    assert opening_mm(jaw, 1.3) == opening_mm(jaw, 1.0)
    rotation, translation = jaw_transform(jaw, 1.0)
    incisor = rotation @ jaw.incisor + translation
    assert incisor[2] < jaw.incisor[2] - 33 and abs(incisor[0]) < 1e-9
    # The condyles slide forward and down from the first millimetre on.
    tenth, full = (slid(jaw, (x, 0, 0))[0] for x in (0.1, 1.0))
    np.testing.assert_allclose(tenth, 0.1 * full, atol=0.1)
    assert 10 < np.linalg.norm(full) < 12 and full[1] < -4 and full[2] < -2


@pytest.mark.parametrize("opening", [0.1, 0.5, 1.0])
def test_an_opening_jaw_turns_about_a_point_below_its_condyles(head, opening):
    """32 mm below them, deviation 7, and 0 behind, deviation 11 (Mehl et al. 2025); our slide is one of the shorter ones."""
    rotation, translation = jaw_transform(head.jaw, opening)
    fixed = np.linalg.solve(np.eye(2) - rotation[1:, 1:], translation[1:])
    behind, above = fixed - (head.jaw.condyle_l + head.jaw.condyle_r)[1:] / 2
    assert -32.4 < above < -32.4 + 2.2 * 7.4
    assert -2 * 10.8 < behind < 2 * 10.8


def slid(jaw, pose):
    """How far the left and the right condyle and the incisors go."""
    rotation, translation = jaw_transform(jaw, *pose)
    return [rotation @ p + translation - p for p in (jaw.condyle_l, jaw.condyle_r, jaw.incisor)]


@pytest.mark.parametrize("side", [1, -1])
def test_jaw_goes_aside_about_the_working_condyle(head, side):
    left, right, incisor = slid(head.jaw, (0, 0, side))
    working, other = (left, right) if side > 0 else (right, left)
    assert 8 < side * incisor[0] < 10
    assert np.linalg.norm(working) < 1.6
    assert 6 < np.linalg.norm(other) < 12 and other[1] < -5 and other[2] < -2  # forward and down
    # Nothing is left of it in the wide open mouth.
    wide = np.subtract(slid(head.jaw, (1, 0, side)), slid(head.jaw, (1, 0, 0)))
    assert np.abs(wide).max() < 1e-9


def test_jaw_comes_forward_but_hardly_back(head):
    assert 7 < np.linalg.norm(slid(head.jaw, (0, 1, 0))[2]) < 9
    assert np.linalg.norm(slid(head.jaw, (0, -1, 0))[2]) < 1.5
    assert np.linalg.norm(slid(head.jaw, (0, 3, 0))[2]) < 9


POSES = [
    *((x, 0.0, 0.0) for x in (0.1, 0.3, 0.5, 0.7, 0.9, 1.0)), (0, 1, 0), (0, 0.5, 0), (0, -1, 0), (0.3, 0, 1), (0, 0, 1),
    (0, 0, 0.5), (0.5, 1, 0), (0, 0.6, 1), (0.7, 0, 1),
]  # fmt: skip


def test_jaw_moves_without_cutting_the_skull(head):
    """Over its whole range the mandible stays clear of the skull; the condyle may brush the eminence by 0.3 mm."""
    jaw, mandible, skull = head.jaw, head.parts["mandible"], head.parts["skull"]
    surface = Surface(skull.vertices, skull.triangles)
    high = mandible.vertices[mandible.vertices[:, 2] > jaw.incisor[2] + 12]
    for pose in POSES:
        rotation, translation = jaw_transform(jaw, *pose)
        moved = high @ rotation.T + translation
        cut = moved[inside(moved, skull.vertices, skull.triangles)]
        assert not len(cut) or depth_under(cut, surface, 6.0)[0].max() < 0.3, pose


@pytest.mark.parametrize(("part", "row"), [("skull", "upper"), ("mandible", "lower")])
def test_every_tooth_has_a_socket(head, part, row):
    """Under each of the sixteen necks the bone is open, with walls on the side of the lips and of the tongue."""
    mesh = head.parts[part]
    groups = {n: np.asarray(w) for n, w in head.groups.items()}
    places = tooth_places(head.skin, groups, head.landmark_positions())[row]
    for flip in ([1, 1, 1], [-1, 1, 1]):
        for number, place in enumerate(places):
            way = (place.neck + np.outer(np.arange(1.0, 18, 0.25), place.axis)) * flip
            free = ~inside(way, mesh.vertices, mesh.triangles)
            end = free.argmin()
            assert not free.all() and 2 < end * 0.25 + 1 < 17, (row, number)
            # A ring round the root somewhere above the socket's end lies in bone.
            turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
            best = 0.0
            for back in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0):
                centre = place.neck + place.axis * (end * 0.25 + 1 - back)
                for more in (0.6, 0.9, 1.2):
                    ring = centre + np.outer(np.cos(turn), place.axes[0]) * (place.md_neck / 2 + 0.5 * more)
                    ring = ring + np.outer(np.sin(turn), place.axes[1]) * (place.ll_neck / 2 + more)
                    best = max(best, inside(ring * flip, mesh.vertices, mesh.triangles).mean())
            assert best >= 0.4, (row, number, best)


def test_skull_and_mandible_have_their_features(head):
    """Free and solid places that a sphere or a tube would not have."""
    bone, eye = head.skull_landmark_positions(), head.eyes[0].centre
    skull, mandible, jaw = head.parts["skull"], head.parts["mandible"], head.jaw
    c = jaw.condyle_l
    free = [
        eye + [-8, 22, 2],  # the orbit is deep
        bone["po_l"] + [0, 1.5, -5],  # ear canal
        [0, bone["ans"][1] + 8, bone["ans"][2] + 10],  # nasal aperture
        c,  # the fossa holds the condyle
        [0, bone["po_l"][1] + 19, -26],  # foramen magnum
        [0, bone["ans"][1] + 25, bone["ans"][2] - 9],  # under the palate
    ]
    assert not inside(np.array(free, float), skull.vertices, skull.triangles).any()
    solid = [
        bone["po_l"] + [-5, 15, -16],  # mastoid process
        bone["ans"] + [0, 6, -1],  # anterior nasal spine
        c + [1, -12, 4.5],  # articular eminence
        [0, bone["ans"][1] + 25, bone["ans"][2] + 1],  # palate
        bone["op"] + [0, -14, -20],  # occipital protuberance
    ]
    found = inside(np.array(solid, float), skull.vertices, skull.triangles)
    assert found.all(), found
    coronoid = mandible.vertices[(mandible.vertices[:, 1] < c[1] - 20) & (mandible.vertices[:, 2] > c[2] - 12)]
    assert len(coronoid) > 8  # the coronoid process reaches as high as the joint
    notch = [[c[0] - 2, c[1] - 14, c[2] - 3]]
    assert not inside(notch, mandible.vertices, mandible.triangles)[0]  # the notch lies between them
    front = mandible.vertices[np.abs(mandible.vertices[:, 0]) < 2]
    assert front[:, 2].max() - front[:, 2].min() > 22  # the body's height in front


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


@pytest.mark.parametrize("pose", [(0, 0.3, 0), (0, 1, 0), (0, -1, 0), (0, 0, 0.5), (0, 0, -1)])
def test_teeth_guide_the_jaw_past_each_other(head, pose):
    rotation, translation = jaw_transform(head.jaw, *pose)
    upper, lower = (crowns_alone(head.parts[part]) for part in ("teeth_upper", "teeth_lower"))
    moved = lower.vertices @ rotation.T + translation
    assert len(piercings(upper.vertices, upper.triangles, moved, lower.triangles)) == 0


def crowns_alone(mesh):
    crown = crowns(mesh)
    crown[mesh.faces[mesh.material != 0].clip(min=0).ravel()] = False
    return Mesh(mesh.vertices, mesh.faces[crown[mesh.faces].all(axis=1) & (mesh.faces[:, 3] >= 0)])
