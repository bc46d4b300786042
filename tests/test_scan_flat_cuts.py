# SPDX-License-Identifier: GPL-3.0-or-later
"""Flat ends of scans are told from heads, and nothing is fitted to them."""

import numpy as np
import pytest

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import cuts_of, scan_surface
from headshop.sim.adapt.skin_fit import fit_skin
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.errors import InputError
from headshop.sim.landmarks import looking
from headshop.sim.landmarks.confidence import judge
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import drawn, smoother
from headshop.sim.progress import finish
from headshop.sim.scan.flat_cuts import beyond, flat_cuts


class SeenError(Exception):
    """What was to be seen was seen."""


ABOVE = 35.0  # mm above the upper edge of the ears' attachment: the crown is cut off there


@pytest.fixture(scope="module")
def height(reference):
    """Where the volume ends, mm."""
    return reference.landmark_positions()["obs_l"][2] + ABOVE


@pytest.fixture(scope="module")
def cut_off(reference, height):
    """The outside of the reference as a volume shows it that ends in a flat top: (vertices, triangles)."""
    rows, quads = smoother(reference.skin.faces, len(reference.skin.vertices))
    vertices = rows @ reference.skin.vertices
    inner = rows @ reference.groups["inner"] > 0.5
    triangles = Mesh(vertices, quads).triangles
    vertices[:, 2] = np.minimum(vertices[:, 2], height)
    return vertices, triangles[~inner[triangles].any(axis=1)]


def test_a_flat_top_is_found_wherever_it_faces(cut_off, height):
    vertices, triangles = cut_off
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    for matrix, shift in ((np.eye(3), np.zeros(3)), (turn, np.array([30.0, -200.0, 90.0]))):
        surface = Surface(vertices @ matrix.T + shift, triangles)
        (plane,) = cuts_of(surface)
        np.testing.assert_allclose(plane[:3], matrix[:, 2], atol=0.02)
        top = matrix @ [0, 0, height] + shift
        assert plane[:3] @ top == pytest.approx(plane[3], abs=1.0)
        cut = beyond(np.array([plane]), surface.vertices)
        height_of = (surface.vertices - shift) @ matrix[:, 2]
        assert cut[height_of > height - 1].all() and not cut[height_of < height - 8].any()


def test_heads_and_their_parts_have_no_flat_ends(reference):
    skin = reference.skin
    whole = drawn(skin.faces, skin.vertices)
    assert len(cuts_of(Surface(whole, skin.triangles))) == 0
    mask = skin.triangles[(whole[skin.triangles][..., 1] < 0).all(axis=1)]
    assert len(cuts_of(Surface(whole, mask))) == 0
    nothing = np.zeros((0, 3))
    assert flat_cuts(nothing, nothing.astype(int), nothing, np.zeros(0)).shape == (0, 4)


def test_a_wall_behind_a_head_that_stands_before_it_is_no_end(reference):
    """A flat that has a good part of the surface on both of its sides ends nothing."""
    skin = reference.skin
    x, z = np.meshgrid(np.linspace(-150, 150, 20), np.linspace(-150, 150, 20), indexing="ij")
    wall = np.stack([x, np.full_like(x, float(skin.vertices[:, 1].mean())), z], axis=-1).reshape(-1, 3)
    k = np.arange(400).reshape(20, 20)
    faces = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([skin.triangles, Mesh(wall, faces).triangles + len(skin.vertices)])
    assert len(cuts_of(Surface(np.concatenate([skin.vertices, wall]), triangles))) == 0


def test_the_crown_is_invented_where_the_scan_is_cut_off(reference, cut_off, height):
    marks = reference.landmark_positions()
    given = {n: marks[n] for n in SKIN if n in marks and marks[n][2] < height - 10}
    scan = Mesh.from_triangles(*cut_off)
    target = scan_surface(reference, scan, given)
    assert target.vertices[:, 2].max() < height - 1 and target.border_vertex.any()
    fit = finish(fit_skin(reference, target, given))
    true = drawn(reference.skin.faces, reference.skin.vertices)
    over = true[:, 2] > height + 5
    assert fit.fitted.fitted[over].max() == 0
    assert np.linalg.norm(fit.fitted.vertices - true, axis=1)[over].max() < 4


def test_landmarks_on_a_flat_end_are_in_mid_air(reference, cut_off, height):
    space = shape_space(reference)
    marks = reference.landmark_positions()
    target = Surface(*cut_off, smooth=2.0)
    work = fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0), rounds=((0.05, 10.0, 5.0, 3.0),) * 3)
    while True:
        try:
            next(work)
        except StopIteration as end:
            fit = end.value
            break
    positions = {n: marks[n] for n in ("prn", "gn", "en_l", "t_r")} | {"v": [*marks["v"][:2], height]}
    _, mid_air, missing = judge(space, fit, target, {n: np.asarray(p, float) for n, p in positions.items()})
    assert "v" in mid_air + missing and "prn" not in mid_air + missing


def test_who_wants_to_keep_a_flat_end_does(reference, cut_off, height):
    marks = reference.landmark_positions()
    given = {n: marks[n] for n in SKIN if n in marks and marks[n][2] < height - 10}
    scan = Mesh.from_triangles(*cut_off)
    found = {}
    for choice in ("auto", "never", "depth_jumps,held_by_lips,hair"):
        built = finish(build_head(reference, scan, given, detail=0, leave_out=choice))
        on_top = built.head.skin.vertices[:, 2] > height - 2
        found[choice] = np.isfinite(built.attributes["distance_mm"][on_top]).sum()
        assert bool(built.fit["left_out_mm2"]["flat_ends"]) == (choice == "auto")
        assert ("left out: a flat end;" in built.fit["sentence"]) == (choice == "auto")
    assert found["auto"] == 0 < found["never"] <= found["depth_jumps,held_by_lips,hair"]
    with pytest.raises(InputError, match="auto, never, or"):
        finish(build_head(reference, scan, given, leave_out="sometimes"))


def test_no_face_is_looked_for_on_a_flat_top(reference, cut_off, height, monkeypatch):
    searched = []

    def search(points, *_):
        searched.append(points)
        raise SeenError
        yield

    monkeypatch.setattr(looking, "search_poses", search)
    with pytest.raises(SeenError):
        finish(find_landmarks(Mesh.from_triangles(*cut_off), reference))
    assert len(searched[0]) > 1000 and searched[0][:, 2].max() < height - 1
    monkeypatch.setattr(looking, "cuts_of", lambda surface: np.zeros((0, 4)))
    with pytest.raises(SeenError):
        finish(find_landmarks(Mesh.from_triangles(*cut_off), reference))
    assert searched[1][:, 2].max() > height - 1  # what is to be left out was there
