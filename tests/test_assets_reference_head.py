# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference head as shipped: connectivity, symmetry, landmarks, regions, measurements; it can be remade."""

import numpy as np
import pytest

from headshop.assets.generators.eye_frame import RADIUS, eye_frames
from headshop.assets.generators.skin import make_skin
from headshop.assets.generators.skin_layout import skin_layout
from headshop.assets.generators.skin_norms import norms
from headshop.assets.generators.steps import rounded
from headshop.sim.anatomy.eyeball import reach
from headshop.sim.anatomy.head import PARTS, SKIN_GROUPS
from headshop.sim.anatomy.landmark_names import SKIN, SKULL, mirrored
from headshop.sim.anatomy.storage import load_head, reference_head
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import edges, vertex_normals
from headshop.sim.mesh_subdivision import drawn, subdivision


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def layout():
    return skin_layout()


def directed_edges(faces):
    return np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])


def piercings(vertices, triangles):
    """Pairs (edge's triangle, triangle) that cut each other and share no vertex (grid of boxes, then Möller 1997)."""
    low, high = vertices[triangles].min(axis=1), vertices[triangles].max(axis=1)
    cell = 6.0
    first, last = np.floor(low / cell).astype(int), np.floor(high / cell).astype(int)
    size = last - first + 1
    count = size.prod(axis=1)
    owner = np.repeat(np.arange(len(triangles)), count)
    rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    spot = np.stack(
        [rank // (size[owner, 1] * size[owner, 2]), rank // size[owner, 2] % size[owner, 1], rank % size[owner, 2]], 1
    )
    key = (first[owner] + spot + 100) @ np.array([1_000_000, 1_000, 1])
    order = np.argsort(key, kind="stable")
    key, owner = key[order], owner[order]
    pairs = []
    ahead = 1
    while True:  # every pair in the same cell, cell neighbours taken 1, 2, 3 ... apart in the sorted list
        same = key[ahead:] == key[:-ahead]
        if not same.any():
            break
        pairs.append(np.stack([owner[:-ahead][same], owner[ahead:][same]], axis=1))
        ahead += 1
    pairs = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    a, b = pairs.T
    apart = ((low[a] > high[b]) | (low[b] > high[a])).any(axis=1)
    shared = (triangles[a][:, :, None] == triangles[b][:, None, :]).any(axis=(1, 2))
    a, b = a[~apart & ~shared], b[~apart & ~shared]
    hits = []
    for edge_of, face in ((a, b), (b, a)):
        p0, p1, p2 = (vertices[triangles[face][:, k]] for k in range(3))
        e1, e2 = p1 - p0, p2 - p0
        for k in range(3):
            start = vertices[triangles[edge_of][:, k]]
            along = vertices[triangles[edge_of][:, (k + 1) % 3]] - start
            h = np.cross(along, e2)
            det = (h * e1).sum(axis=1)
            inverse = 1 / np.where(np.abs(det) > 1e-12, det, np.inf)
            off = start - p0
            q = np.cross(off, e1)
            u, v, t = (off * h).sum(1) * inverse, (along * q).sum(1) * inverse, (e2 * q).sum(1) * inverse
            cut = (np.abs(det) > 1e-12) & (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
            hits.append(np.stack([edge_of[cut], face[cut]], axis=1))
    return np.concatenate(hits)


def test_it_is_complete(head):
    assert set(head.parts) == set(PARTS)
    assert set(head.groups) == set(SKIN_GROUPS)
    assert head.landmarks.names == SKIN and set(head.skull_landmarks.names) == set(SKULL)
    assert len(head.muscles) >= 24


def test_skin_is_quads_with_the_bust_as_its_only_edge(head, layout):
    faces = head.skin.faces
    assert (faces >= 0).all(axis=1).mean() >= 0.97
    assert 1500 <= len(head.skin.vertices) <= 2500
    pairs = directed_edges(faces)
    assert len(np.unique(pairs, axis=0)) == len(pairs), "an edge is used twice in one direction"
    keys = {tuple(p) for p in pairs.tolist()}
    open_ = {p for p in keys if p[::-1] not in keys}
    assert {v for p in open_ for v in p} == set(layout.edge.tolist())
    assert len(np.unique(faces)) == len(head.skin.vertices)


def test_poles_are_few_and_none_is_on_lips_lids_or_nose_wings(head, layout):
    pairs = edges(head.skin.faces)
    neighbours = np.bincount(pairs.ravel(), minlength=layout.count)
    inside = np.setdiff1d(np.arange(layout.count), layout.edge)
    assert set(np.unique(neighbours[inside])) <= {3, 4, 5}
    assert (neighbours[inside] != 4).mean() < 0.10
    moving = [layout.rings["mouth"][1:8], layout.rings["eye_l"][1:7], layout.rings["nostril_l"][1:3]]
    for rings in moving:
        assert (neighbours[rings] == 4).all()


def test_loops_run_along_brow_fold_wing_and_jaw(head, layout):
    """Each line of the net stays within a few mm of landmarks that lie on the form it follows."""
    at, v, grid = head.landmark_positions(), head.skin.vertices, layout.grid
    lines = {
        "brow": (grid[4:6, 2:11].ravel(), ("os_l", "sci_l"), 7.0),
        "nasolabial fold": (grid[14:20, 5], ("ac_l",), 8.0),
        "nose wing": (grid[12:16, 4], ("al_l",), 7.0),
        "jaw line": (np.r_[grid[24, 5:14], grid[25, :5]], ("gn", "go_l"), 8.0),
    }
    for name, (line, marks, near) in lines.items():
        points = v[line[line >= 0]]
        for mark in marks:
            assert np.linalg.norm(points - at[mark], axis=1).min() < near, (name, mark)
    fold = v[grid[14:20, 5]]
    assert (np.diff(fold[:, 2]) < 0).all() and (np.diff(fold[1:, 0]) > 0).all()  # down and outward round the mouth
    jaw = v[grid[24, 0:14]]
    assert (np.diff(jaw[:, 1]) > 0).all() and jaw[-1, 2] > jaw[0, 2] + 25  # back and up to the angle


def test_skin_is_its_own_mirror_image(head, layout):
    vertices, mirror = head.skin.vertices, layout.mirror
    np.testing.assert_array_equal(vertices[mirror], vertices * [-1, 1, 1])
    mirrored_faces = {tuple(np.sort(f)) for f in mirror[head.skin.faces].tolist()}
    assert mirrored_faces == {tuple(np.sort(f)) for f in head.skin.faces.tolist()}
    for name, weights in head.groups.items():
        np.testing.assert_array_equal(head.groups[mirrored(name)], weights[mirror], err_msg=name)


def test_skin_faces_outward_and_loops_are_concentric(head, layout):
    v, triangles = head.skin.vertices, head.skin.triangles
    normal = vertex_normals(v, triangles)
    crown = layout.crown.ravel()
    assert (normal[crown, 2] > 0.3).all()
    assert (normal[layout.grid[1:25, 0], 1][[0, 1, 2, 3, 10, 11, 22]] < 0).all()
    volume = np.einsum("ij,ij->i", v[triangles[:, 0]], np.cross(v[triangles[:, 1]], v[triangles[:, 2]])).sum() / 6
    assert 3.0e6 < volume < 6.5e6  # mm³
    assert len(layout.rings["mouth"]) > 5 and len(layout.rings["eye_l"]) > 4


@pytest.mark.parametrize("levels", [0, 1])
def test_skin_does_not_cut_itself(head, levels):
    operator, faces, _ = subdivision(head.skin.faces, len(head.skin.vertices), levels)
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    assert len(piercings(operator @ head.skin.vertices, triangles)) == 0


def test_self_intersection_is_found_when_there_is_one(head, layout):
    pushed = head.skin.vertices.copy()
    pushed[layout.rings["mouth"][6, 8:15], 2] += 3.0  # the lower lip through the upper
    assert len(piercings(pushed, head.skin.triangles)) > 0


def test_lips_touch_without_a_gap_one_can_see(head, layout):
    for ring in (6, 7):
        loop = head.skin.vertices[layout.rings["mouth"][ring]]
        gap = loop[20:28, 2] - loop[18:10:-1, 2]
        assert (gap > 0).all() and (gap < 0.5).all()


def test_lid_margins_lie_on_the_eyeball(head, layout):
    left, right = eye_frames(head.skin.vertices)
    assert np.allclose(left.centre * [-1, 1, 1], right.centre, atol=1e-9) and left.radius == RADIUS
    assert np.allclose(head.eyes[0].centre, left.centre, atol=0.1)
    margin = head.skin.vertices[layout.rings["eye_l"][6]]
    away = margin - left.centre
    far = np.linalg.norm(away, axis=1)
    gap = far - reach(left, np.arccos(-away[:, 1] / far))
    between_corners = [*range(5, 14), *range(15, 24)]
    assert (gap[between_corners] >= 0).all() and (gap[between_corners] <= 0.5).all()


def test_landmarks_are_on_the_skin_and_symmetric(head):
    points = head.landmarks
    assert set(points.part) == {"skin"}
    assert (points.weights >= 0).all() and np.allclose(points.weights.sum(axis=1), 1)
    rows = {tuple(sorted(t)) for t in head.skin.triangles.tolist()}
    used = [tuple(sorted(c)) for c in points.corners.tolist()]
    assert all(c in rows for c, n in zip(used, points.names, strict=True) if not n.endswith("_r"))
    at = head.landmark_positions()
    for name in SKIN:
        np.testing.assert_allclose(at[mirrored(name)], at[name] * [-1, 1, 1], atol=2e-5, err_msg=name)
    middle = 0.5 * (at["t_l"] + at["t_r"])
    assert np.abs(middle).max() < 2.0 and abs(at["or_l"][2]) < 2.0  # origin and Frankfurt horizontal
    order = [at[n][2] for n in ("v", "tr", "g", "n", "se", "prn", "sn", "ls", "sto", "li", "sl", "pg", "gn")]
    assert order == sorted(order, reverse=True)
    assert at["t_l"][0] > 60 and at["prn"][1] < at["sn"][1] < at["t_l"][1] < at["op"][1]


def test_groups_are_smooth_weights_in_their_places(head, layout):
    for name, weights in head.groups.items():
        assert weights.shape == (len(head.skin.vertices),) and weights.min() >= 0 and weights.max() <= 1, name
        assert weights.max() > 0.6, name
    jaw, inner = head.groups["jaw"], head.groups["inner"]
    at = {n: c[0] for n, c in zip(head.landmarks.names, head.landmarks.corners, strict=True)}
    assert jaw[at["li"]] > 0.95 and jaw[at["pg"]] > 0.95 and jaw[at["ls"]] < 0.05 and jaw[at["v"]] == 0
    assert 0.3 < jaw[at["ch_l"]] < 0.7
    assert (inner[layout.patches["mouth"]] == 1).all() and (inner[layout.patches["eye_l"]] == 1).all()
    assert (inner[layout.grid[layout.grid >= 0]] == 0).all()
    assert head.groups["face"][at["prn"]] == 1 and head.groups["face"][at["op"]] == 0


def test_feature_mesh_uses_all_landmarks_without_folds(head):
    triangles = head.feature_mesh
    assert set(np.unique(triangles)) == set(range(len(SKIN)))
    partner = np.array([SKIN.index(mirrored(n)) for n in SKIN])
    assert {tuple(sorted(t)) for t in partner[triangles].tolist()} == {tuple(sorted(t)) for t in triangles.tolist()}
    pairs = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    at = np.array([head.landmark_positions()[n] for n in SKIN])
    a, b, c = (at[triangles[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c - 3 * np.array([0, -20.0, 0]))
    assert (outward > 0).all()


def overlaps(corners):
    """Pairs of triangles (t, 3, 2), counter-clockwise, whose interiors meet: no edge of either separates them."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    first = np.floor(low * 64).astype(int)
    size = np.floor(high * 64).astype(int) - first + 1
    count = size.prod(axis=1)
    owner = np.repeat(np.arange(len(corners)), count)
    rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    key = (first[owner, 0] + rank % size[owner, 0]) * 1000 + first[owner, 1] + rank // size[owner, 0]
    order = np.argsort(key, kind="stable")
    key, owner = key[order], owner[order]
    pairs, ahead = [], 1
    while (same := key[ahead:] == key[:-ahead]).any():
        pairs.append(np.stack([owner[:-ahead][same], owner[ahead:][same]], axis=1))
        ahead += 1
    a, b = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0).T
    apart = ((low[a] >= high[b]) | (low[b] >= high[a])).any(axis=1)
    for one, two in ((a, b), (b, a)):
        for k in range(3):
            start = corners[one][:, k]
            edge = corners[one][:, (k + 1) % 3] - start
            to = corners[two] - start[:, None]
            apart |= (edge[:, None, 0] * to[..., 1] - edge[:, None, 1] * to[..., 0] <= 1e-9).all(axis=1)
    return np.stack([a[~apart], b[~apart]], axis=1)


def areas(triangles):
    """Signed areas of (t, 3, 2)."""
    ab, ac = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return 0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])


def test_texture_coordinates_never_overlap_and_are_symmetric(head, layout):
    uv = head.skin.uv.astype(float)
    assert uv.min() >= 0 and uv.max() <= 1
    corners = np.concatenate([uv[:, [0, 1, 2]], uv[:, [0, 2, 3]]])
    assert (areas(corners) > 0).all()
    assert len(overlaps(corners)) == 0
    shifted = corners.copy()
    shifted[0] += 0.02
    assert len(overlaps(shifted)) > 0, "an overlap is found when there is one"
    half = len(uv) // 2
    np.testing.assert_allclose(uv[half:], uv[:half][:, [0, 3, 2, 1]] * [-1, 1] + [1, 0], atol=1e-6)


def test_texture_is_dense_on_the_face(head):
    uv, faces = head.skin.uv.astype(float), head.skin.faces
    v = head.skin.vertices
    flat = areas(uv[:, [0, 1, 2]]) + areas(uv[:, [0, 2, 3]])
    real = 0.5 * np.linalg.norm(np.cross(v[faces[:, 2]] - v[faces[:, 0]], v[faces[:, 3]] - v[faces[:, 1]]), axis=1)
    density = np.sqrt(flat / real)
    seen = (head.groups["inner"][faces] < 0.5).all(axis=1)
    face = seen & (head.groups["face"][faces] > 0.9).all(axis=1)
    rest = seen & (head.groups["face"][faces] < 0.1).all(axis=1)
    assert np.median(density[face]) > 1.2 * np.median(density[rest])
    spread = density[face] / np.median(density[face])
    assert np.percentile(spread, 5) > 0.6 and np.percentile(spread, 95) < 1.5
    assert flat.sum() > 0.6, "the square is well filled"


def test_measurements_are_those_of_an_adult(head):
    at = head.landmarks.on({"skin": drawn(head.skin.faces, head.skin.vertices)})
    scores = {n.name: n.score(at) for n in norms()}
    assert len(scores) >= 40
    assert max(abs(s) for s in scores.values()) <= 2.0, scores
    assert sum(abs(s) <= 1 for s in scores.values()) >= 30


def test_the_skin_is_remade_from_its_tables(head):
    skin = make_skin()
    np.testing.assert_array_equal(rounded(skin.mesh).vertices, head.skin.vertices)
    np.testing.assert_array_equal(skin.mesh.faces, head.skin.faces)
    np.testing.assert_array_equal(skin.feature_mesh, head.feature_mesh)
    np.testing.assert_array_equal(skin.landmarks.corners, head.landmarks.corners)
    for name, weights in skin.groups.items():
        np.testing.assert_allclose(weights, head.groups[name], atol=1e-5, err_msg=name)


def test_all_who_ask_for_the_reference_head_have_the_same_one_and_cannot_change_it(head):
    ours = reference_head()
    assert ours is reference_head() and shape_space(ours) is shape_space(ours)
    for name, mesh in ours.parts.items():
        np.testing.assert_array_equal(mesh.vertices, head.parts[name].vertices)
        with pytest.raises(ValueError, match="read-only"):
            mesh.vertices[0] = 0
