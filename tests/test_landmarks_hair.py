# SPDX-License-Identifier: GPL-3.0-or-later
"""Thick hair: it stands off the head by centimetres, and takes neither ears nor the crown with it."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.ears import EAR_MARKS
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.confidence import LIKE_AN_EAR, like_ears
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import ShapeFit
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.individual import draw_field

THICK = 20.0  # mm
RISE = 12.0  # mm from where hair begins to where it is as thick
HIGH = 0.2  # of its height above the brows by which the skull is higher than most
SPARE = 30.0  # mm from the tragus that hair leaves free


@pytest.fixture(scope="module")
def hairy(reference):
    """Somebody with a high skull and thick hair on scalp and nape: the scan, the skin below, and its landmarks (mm)."""
    field = draw_field(reference.landmark_positions(), np.random.default_rng(5))
    skin = reference.skin
    whole = drawn(skin.faces, skin.vertices + field(skin.vertices))
    rest = reference.landmark_positions()
    above = np.maximum(skin.vertices[:, 2] - rest["g"][2], 0)
    whole[:, 2] += HIGH * above**2 / above.max()
    grows = reference.groups["scalp"] > 0.5
    grows |= (skin.vertices[:, 1] > rest["pa_l"][1] + 15) & (skin.vertices[:, 2] > rest["gn"][2] + 25)
    free = cKDTree(skin.vertices[~grows]).query(skin.vertices)[0]
    free = np.minimum(free, cKDTree([rest["t_l"], rest["t_r"]]).query(skin.vertices)[0] - SPARE)
    rise = THICK * np.clip(free / RISE, 0, 1) * grows
    outer = skin.triangles[~(reference.groups["inner"] > 0.5)[skin.triangles].any(axis=1)]
    points = whole + rise[:, None] * vertex_normals(whole, outer)
    parts = {name: part.vertices for name, part in reference.parts.items() if name != "skin"}
    truth = reference.landmarks.on({"skin": whole} | parts)
    return Mesh.from_triangles(points, outer), whole, truth


def test_ears_are_found_below_thick_hair(hairy, reference):
    scan, _, truth = hairy
    found = finish(find_landmarks(scan, reference))
    ears = [n for n in SKIN if n.rpartition("_")[0] in EAR_MARKS]
    off = [np.linalg.norm(found.positions[n] - truth[n]) for n in ears if n in found.positions]
    assert len(off) > len(ears) / 2
    assert np.mean(off) < 7.0
    crown = found.positions["v"][2]
    assert truth["v"][2] - 10 < crown < truth["v"][2] + THICK + 3


def test_a_head_with_thick_hair_has_a_whole_crown(hairy, reference):
    """Without landmarks of the skull, which hair hides, the crown is neither cut off nor dented."""
    scan, _, truth = hairy
    given = {n: truth[n] for n in SKIN if n.rpartition("_")[0] not in ("eu", "ft") and n not in ("v", "op", "tr")}
    head = finish(build_head(reference, scan, given, detail=0)).head
    skin = head.skin
    top = drawn(skin.faces, skin.vertices)[:, 2].max()
    assert truth["v"][2] - 8 < top < truth["v"][2] + THICK + 3


def test_hair_over_ears_is_smoother_than_ears(reference):
    """The landmarks of what lies as near as an ear, but has none of its folds, are not those of an ear."""
    space = shape_space(reference)
    covered = space.points.copy()
    ears = np.flatnonzero(space.ear > 0.2)
    near = cKDTree(space.points).query(space.points[ears], 60)[1]
    for _ in range(20):
        covered[ears] = covered[near].mean(axis=1)
    none = np.zeros(len(space.points))
    fit = ShapeFit(space.points, none[:1], Pose(1.0, np.eye(3), none[:3], 0.0), none + 1, none, np.zeros((1, 1)))
    for points, seen in ((space.points, True), (covered, False)):
        like = like_ears(space, fit, Surface(points, space.triangles))
        assert [like[side] > LIKE_AN_EAR for side in "lr"] == [seen, seen]


def test_hair_grows_on_scalp_and_nape_only(reference):
    space = shape_space(reference)
    marks = space.landmarks(space.points)
    near = cKDTree(space.points).query([marks[n] for n in marks])[1]
    grows = {n for n, k in zip(marks, near, strict=True) if space.hairy[k]}
    assert {"v", "op"} <= grows
    bare = {n for n in marks if n.rpartition("_")[0] in EAR_MARKS} | {"g", "n", "prn", "sto", "gn", "zy_l", "zy_r"}
    assert not grows & bare
