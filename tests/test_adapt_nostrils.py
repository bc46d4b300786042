# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep the linings of nostrils lie: as far in as the scan shows, or else as noses are."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.follow import follow
from headshop.sim.adapt.nostril_walls import DEEP, within_bone
from headshop.sim.adapt.rest import rest_of
from headshop.sim.adapt.skin_cover import signed_depth
from headshop.sim.adapt.vestibules import vestibules
from headshop.sim.mesh_piercing import self_piercings
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish


@pytest.fixture(scope="module")
def rest(reference):
    return rest_of(reference)


def _scan(rest, offset=None):
    """The reference's own seen skin, and both nostrils covered by a film so far (3,) mm from their rims, if any."""
    skin = rest.head.skin
    surface = drawn(skin.faces, skin.vertices)
    triangles = skin.triangles[~rest.inner[skin.triangles].any(axis=1)]
    if offset is None:
        return Surface(surface, triangles)
    x, y = np.meshgrid(np.linspace(-25, 25, 26), np.linspace(-125, -60, 33))
    grid = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    rows = rest.organs["nostrils"]
    rim = np.flatnonzero(rest.rim & (np.asarray(rest.link[rows].sum(axis=0)).ravel() > 0))
    grid[:, 2] = skin.vertices[rim, 2].mean() + offset
    k = np.arange(33 * 26).reshape(33, 26)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    film = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])  # faces down, out of the nostrils
    return Surface(np.concatenate([surface, grid]), np.concatenate([triangles, film + len(surface)]))


def test_nostrils_lead_to_the_aperture_where_no_data_is(reference, rest):
    skin = reference.skin.vertices
    moved = vestibules(rest, skin, _scan(rest))
    rows = rest.organs["nostrils"]
    assert (moved[np.setdiff1d(np.arange(len(skin)), rows)] == 0).all()
    deep = rows[rest.behind[rows] > 1]
    assert moved[deep, 1].min() > 8
    septum = 2 * np.abs((skin + moved)[deep, 0]).min()
    assert 3.0 < septum < 6.0
    hindmost = (skin + moved)[rows, 1].max()
    assert abs(hindmost - reference.skull_landmark_positions()["ans"][1]) < 8
    head = finish(follow(reference, skin, None, moved)).head
    np.testing.assert_allclose((head.skin.vertices - skin)[deep], moved[deep], atol=1.0)
    assert len(self_piercings(drawn(head.skin.faces, head.skin.vertices), head.skin.triangles)) == 0


def test_a_film_over_the_nostrils_tells_nothing(reference, rest):
    assert (vestibules(rest, reference.skin.vertices, _scan(rest, -1.0)) == 0).all()


def test_data_within_bounds_a_nostril(reference, rest):
    skin = reference.skin.vertices
    free, bound = (vestibules(rest, skin, _scan(rest, offset)) for offset in (None, 6.0))
    rows = rest.organs["nostrils"]
    assert np.linalg.norm(bound[rows], axis=1).mean() < 0.7 * np.linalg.norm(free[rows], axis=1).mean()


def test_passages_that_lead_into_bone_narrow_so_that_bone_keeps_its_shape(reference, rest):
    skin, skull, rows = reference.skin.vertices, reference.parts["skull"], rest.organs["nostrils"]
    moved = vestibules(rest, skin, _scan(rest))
    usual = within_bone(rest, skin + moved, skull)
    np.testing.assert_array_equal(np.delete(usual, rows, axis=0), np.delete(skin, rows, axis=0))
    assert np.linalg.norm(usual - skin - moved, axis=1)[rows].mean() < 0.5
    wide = np.array(moved)
    back = rows[rest.behind[rows] > 1]
    wide[back] += [0, 6.0, 0] + np.sign(skin[back, :1]) * [5.0, 0, 0]
    in_bone = [
        signed_depth(at, Surface(skull.vertices, skull.triangles), 20.0, skull)[0].max()
        for at in ((skin + wide)[rows], within_bone(rest, skin + wide, skull)[rows])
    ]
    assert in_bone[0] > 2.0 and in_bone[1] <= DEEP
    before = len(self_piercings(skull.vertices, skull.triangles))
    done = finish(follow(reference, skin, None, wide))
    bone = done.head.parts["skull"]
    near = np.linalg.norm(bone.vertices - skull.vertices, axis=1)
    assert near.max() < 3.0
    assert len(self_piercings(bone.vertices, bone.triangles)) <= before + 4
