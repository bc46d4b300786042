# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips, philtrum, mouth bag and jaw weights as the generators make them: sealed, roomy, fit to open by plain rotation."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.assets.generators.skin_finish import finish_shape
from headshop.assets.generators.skin_groups import skin_groups
from headshop.assets.generators.skin_layout import skin_layout
from headshop.assets.generators.skin_shape import mean_shape
from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.anatomy.storage import load_head
from headshop.sim.health.cuts import self_cuts, smooth_skin
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_piercing import self_piercings
from headshop.sim.mesh_subdivision import limit, subdivision
from headshop.sim.scan.viewpoint import Viewpoint, depth_map

#: Ring indices of the upper and of the lower lip, corners included.
UPPER, LOWER = [*range(19, 32), *range(4)], list(range(3, 20))


@pytest.fixture(scope="module")
def made():
    """The reference skin, its limit surface (two levels) and what of it belongs to the mouth."""
    layout = skin_layout()
    vertices = finish_shape(layout, mean_shape())
    rings, patch = layout.rings["mouth"], layout.patches["mouth"]
    operator, quads, parent = subdivision(layout.faces, layout.count, 2)
    smoother = limit(quads, operator.shape[0]) @ operator
    level = np.full(layout.count, -1)
    for k, ring in enumerate(rings):
        level[ring] = k
    level[np.setdiff1d(patch, rings)] = len(rings)
    return SimpleNamespace(
        layout=layout,
        vertices=vertices,
        groups=skin_groups(layout, vertices),
        rings=rings,
        level=level,
        quads=quads,
        parent=parent,
        smoother=smoother,
        smooth=smoother @ vertices,
        on_limit=limit(layout.faces, layout.count) @ vertices,
    )


def near_mouth(made, vertices, triangles):
    """(m,) bool: triangles between nose and chin, in front of the throat."""
    middle = vertices[triangles].mean(axis=1) - vertices[made.rings[6, 27]]
    return (np.abs(middle) < [45, 75, 32]).all(axis=1)


def pieces(made, faces):
    """Vertices of the limit surface that belong to the faces (m,) bool of the cage."""
    return np.unique(made.quads[faces[made.parent]])


def bag_faces(made):
    return (made.level[made.layout.faces] >= 8).any(axis=1)


@pytest.mark.parametrize("levels", [0, 1])
def test_nothing_cuts_itself_at_the_mouth(made, levels):
    vertices, faces = made.vertices, made.layout.faces
    if levels:
        operator, faces, _ = subdivision(faces, len(vertices), levels)
        vertices = limit(faces, operator.shape[0]) @ (operator @ vertices)
    triangles = Mesh(vertices, faces).triangles
    assert len(self_piercings(vertices, triangles, near_mouth(made, vertices, triangles))) == 0


def test_lips_touch_all_the_way(made):
    faces, level = made.layout.faces, made.level
    lips = ((level[faces] >= 4) & (level[faces] <= 8)).all(axis=1)
    above, below = (
        made.smooth[pieces(made, lips & np.isin(faces, made.rings[:, side]).all(axis=1))] for side in (UPPER, LOWER)
    )
    gap = cKDTree(below).query(above)[0]
    half = made.on_limit[made.rings[3, 19], 0]
    for x in np.linspace(-half + 2, half - 2, 24):
        assert gap[np.abs(above[:, 0] - x) < 1.5].min() < 0.2, x


@pytest.mark.parametrize("yaw", [0, 30, 60])
def test_no_look_gets_between_closed_lips(made, yaw):
    triangles = Mesh(made.smooth, made.quads).triangles
    bag = np.repeat(bag_faces(made)[made.parent], 2)
    near = near_mouth(made, made.smooth, triangles)
    target = made.vertices[made.rings[6, 27]]
    for pitch in (-40, -20, -10, -5, 0, 5, 10, 20, 40):
        view = Viewpoint.around(target, np.radians(yaw), np.radians(pitch), 600.0, 0.2, 56, 20)
        seen = depth_map(view, made.smooth, triangles[near]).triangle
        assert (seen >= 0).mean() > 0.3
        assert bag[near][seen[seen >= 0]].sum() <= 2, (yaw, pitch)


def test_bag_has_room(made):
    line = made.on_limit[made.rings[6, [11, 27]]].mean(axis=0)
    bag = made.smooth[pieces(made, bag_faces(made))] - line
    middle, molars = np.abs(bag[:, 0]) < 3, np.abs(bag[:, 1] - 48) < 3
    assert bag[middle & (bag[:, 1] < 12), 2].max() > 12  # fornix above the upper gums
    assert bag[middle & (bag[:, 1] < 14), 2].min() < -12
    assert bag[middle & (np.abs(bag[:, 1] - 32) < 4), 2].max() > 13.5  # palate
    assert np.abs(bag[molars, 0]).max() > 32
    assert bag[:, 1].max() > 62


def test_flesh_of_lips_and_cheeks(made):
    outside = (made.level[made.layout.faces] <= 3).all(axis=1)
    skin = cKDTree(made.smooth[pieces(made, outside)])
    deep = (made.level[made.layout.faces] >= 8).all(axis=1)
    assert skin.query(made.smooth[pieces(made, deep)])[0].min() > 4
    assert skin.query(made.smooth[pieces(made, bag_faces(made))])[0].min() > 3


def test_measures_of_the_red(made):
    at = made.on_limit[made.rings]
    sto, ls, li = at[6, 27, 2], at[3, 27], at[3, 11]
    assert abs(ls[2] - sto - 7.5) < 1.5 and abs(sto - li[2] - 8.65) < 1.9
    assert abs(2 * at[3, 19, 0] - 49.0) < 3.65
    peak = at[3, np.arange(19, 28)]
    peak = peak[peak[:, 2].argmax()]
    assert abs(2 * peak[0] - 12.45) < 1.7  # philtrum: from peak to peak of Cupid's bow
    assert 0.8 < peak[2] - ls[2] < 2.5


def test_philtrum_has_groove_and_columns(made):
    at = made.on_limit[made.rings]
    for k in (1, 2):
        groove, column, cheek = at[k, 27, 1], at[k, 25, 1], at[k, 23, 1]
        assert groove - column > 0.4, k
        assert cheek - column > 0.4, k


def test_jaw_weights_along_the_lips(made):
    jaw = made.groups["jaw"]
    np.testing.assert_array_equal(jaw, jaw[made.layout.mirror])
    for ring in made.rings[3:8]:
        around = jaw[ring]
        assert abs(around[19] - 0.5) < 0.01
        down, up = around[19 - np.arange(9)], around[19 + np.arange(9)]
        assert (np.diff(down) > 0).all() and (np.diff(up) < 0).all()
        assert down[-1] > 0.99 and up[-1] < 0.01


def test_chin_is_rigid_and_the_rest_stays(made):
    jaw, at = made.groups["jaw"], made.vertices
    corner, below = at[made.rings[3, 19]], at[made.rings[1, 11]]
    chin = (np.abs(at[:, 0]) < 14) & (at[:, 1] < below[1] + 6) & (at[:, 2] < below[2]) & (at[:, 2] > corner[2] - 45)
    assert chin.sum() > 10
    assert jaw[chin].min() > 0.97
    for hole in ("ear_l", "ear_r", "eye_l", "eye_r", "nostril_l", "nostril_r"):
        assert jaw[made.layout.rings[hole]].max() == 0
    assert jaw[at[:, 2] > corner[2] + 62].max() == 0
    assert jaw[at[:, 2] < corner[2] - 90].max() == 0  # below the larynx
    assert jaw[at[:, 1] > 30].max() == 0


def posed_skin(made, pose):
    shipped = load_head()
    skin = Mesh(made.vertices, made.layout.faces)
    head = replace(shipped, parts={**shipped.parts, "skin": skin}, groups=made.groups)
    return plainly_posed(head, **pose).skin


POSES = [
    *({"jaw_open": k} for k in (0.2, 0.5, 0.8, 0.9, 1.0)),
    *({"jaw_side": k} for k in (0.3, 1.0)),
    *({"jaw_forward": k} for k in (0.3, 1.0, -1.0)),
]


@pytest.mark.parametrize("pose", POSES)
def test_no_part_of_the_skin_goes_through_another(made, pose):
    """Throat and lining too, the cage and the surface drawn of it."""
    posed = posed_skin(made, pose)
    smooth = smooth_skin(posed)
    assert self_cuts(posed) == self_cuts(smooth) == 0


@pytest.mark.parametrize("pose", [{"jaw_open": 0.3}, {"jaw_open": 0.6}, {"jaw_open": 1.0}, {"jaw_side": 1.0}])
def test_opens_without_folding(made, pose):
    posed = posed_skin(made, pose)
    outer = near_mouth(made, made.vertices, posed.triangles) & (made.level[posed.triangles] <= 7).all(axis=1)
    if "jaw_open" in pose:
        assert len(self_piercings(posed.vertices, posed.triangles, outer)) == 0
    fine = Mesh(made.smoother @ posed.vertices, made.quads)
    seen = np.repeat((made.level[made.layout.faces] <= 7).all(axis=1)[made.parent], 2)
    seen &= near_mouth(made, made.smooth, fine.triangles)
    a, b, c = (fine.vertices[fine.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    folded = np.einsum("ij,ij->i", normal[::2], normal[1::2]) <= 0
    assert not (folded & seen[::2]).any()  # no small quad of the drawn surface folds over its diagonal
