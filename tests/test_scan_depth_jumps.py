# SPDX-License-Identifier: GPL-3.0-or-later
"""What a depth map stretches over its jumps is told from surface, and the back of the head is invented, not a wall."""

import numpy as np
import pytest

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.depth_jumps import depth_jumps

STEP, WALL = 2.5, 60.0  # mm from place to place; from the back of the head to the wall behind it


@pytest.fixture(scope="module")
def depth_map(reference):
    """The reference before a wall, seen from the front: (Mesh, (m,) bool: triangles between it and the wall)."""
    skin = drawn(reference.skin.faces, reference.skin.vertices)
    low, high = skin.min(axis=0), skin.max(axis=0)
    x, z = np.meshgrid(*(np.arange(low[k] - 30, high[k] + 30, STEP) for k in (0, 2)), indexing="ij")
    eye = np.stack([x, np.full_like(x, low[1] - 50), z], axis=-1).reshape(-1, 3)
    line, far, _, _ = Surface(skin, reference.skin.triangles).crossings(eye, np.tile([0, 1.0, 0], (len(eye), 1)), 500.0)
    depth = np.full(len(eye), np.inf)
    np.minimum.at(depth, line, far)
    on_wall = ~np.isfinite(depth)
    eye[:, 1] = np.where(on_wall, high[1] + WALL, eye[:, 1] + depth)
    eye += np.random.default_rng(1).normal(0, 0.1, eye.shape)
    k = np.arange(len(eye)).reshape(x.shape)
    faces = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    mesh = Mesh(eye, faces)
    walls = on_wall[mesh.triangles]
    return mesh, walls.any(axis=1) & ~walls.all(axis=1)


def test_jumps_are_found_in_any_unit_and_nothing_else_is(depth_map):
    mesh, between = depth_map
    found = depth_jumps(mesh.vertices, mesh.triangles)
    assert found[between].mean() > 0.95
    steep = mesh.vertices[mesh.triangles][:, :, 1]
    assert np.ptp(steep[found & ~between], axis=1).min(initial=99) > 10  # over the nose's edge, behind the ears
    assert (depth_jumps(mesh.vertices / 1000, mesh.triangles) == found).all()


def test_no_other_mesh_has_any(reference):
    for part in ("skin", "skull", "mandible"):
        mesh = reference.parts[part]
        assert not depth_jumps(mesh.vertices, mesh.triangles).any()
    floor = np.array([[-300, -300, -150], [300, -300, -150], [300, 300, -150], [-300, 300, -150.0]])
    n = len(reference.skin.vertices)
    both = np.concatenate([reference.skin.triangles, [[n, n + 1, n + 2], [n, n + 2, n + 3]]])
    assert not depth_jumps(np.concatenate([reference.skin.vertices, floor]), both).any()


def test_the_back_of_the_head_is_no_wall(depth_map, reference):
    mesh, _ = depth_map
    found = finish(find_landmarks(mesh, reference))
    marks = reference.landmark_positions()
    assert {"op", "v"} <= set(found.mid_air) | set(found.missing)
    assert np.mean([np.linalg.norm(found.positions[n] - marks[n]) for n in ("prn", "en_l", "ch_r", "gn", "sn")]) < 2.5
    given = {n: marks[n] for n in SKIN if n in marks and n not in ("v", "op")}
    others = "flat_ends,held_by_lips,hair"
    built = {keep: finish(build_head(reference, mesh, given, detail=0, leave_out=keep)) for keep in ("auto", others)}
    off = {
        keep: np.linalg.norm(head.head.skin.vertices - reference.skin.vertices, axis=1)[reference.groups["scalp"] > 0.5]
        for keep, head in built.items()
    }
    without, walled = (np.percentile(off[keep], 95) for keep in ("auto", others))
    assert without < 5.0 and walled > 2 * without
    assert built["auto"].fit["left_out_mm2"]["depth_jumps"] > 10_000
    assert built[others].fit["left_out_mm2"]["depth_jumps"] == 0
    assert "left out: what is stretched over the jumps of a depth map" in built["auto"].fit["sentence"]
