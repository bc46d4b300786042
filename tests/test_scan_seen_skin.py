# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as it is seen: eyeballs between the lids, no fold at the corners of mouth and lids."""

import numpy as np

from headshop.sim.adapt.untangle import sharp
from headshop.sim.anatomy.eyeball import reach
from headshop.sim.anatomy.seen_skin import behind_lids, seen_skin
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_piercing import self_piercings
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.mesh_unfolding import unfolded


def test_the_film_between_the_lids_lies_on_the_eyeball(reference):
    seen = seen_skin(reference)
    for eye, side in zip(reference.eyes, "lr", strict=True):
        film = seen.vertices[: len(reference.skin.vertices)][behind_lids(reference, side)] - eye.centre
        far = np.linalg.norm(film, axis=1)
        above = far - reach(eye, np.arccos(film @ eye.gaze / far))
        assert (film @ eye.gaze > 0).all() and -0.01 < above.min() and above.max() < 2.5
        assert np.median(above) < 0.3


def test_nothing_is_folded_and_little_is_moved(reference):
    seen = seen_skin(reference)
    assert len(sharp(seen.vertices, seen.triangles)) == 0


def test_lips_that_pierce_each_other_a_little_are_freed(reference):
    skin = reference.skin
    lower = np.asarray(reference.groups["lip_lower"])
    pressed = reference.with_vertices({"skin": skin.vertices + [0, 0, 0.3] * lower[:, None]})
    rows, quads = smoother(skin.faces, len(skin.vertices))
    raw = Mesh(rows @ pressed.skin.vertices, quads)
    assert len(self_piercings(raw.vertices, raw.triangles)) > 10
    seen = seen_skin(pressed)
    assert len(self_piercings(seen.vertices, seen.triangles)) == len(sharp(seen.vertices, seen.triangles)) == 0
    film = behind_lids(reference, "l") | behind_lids(reference, "r")
    off = np.linalg.norm(seen.vertices - raw.vertices, axis=1)[: len(film)][~film]
    assert off.max() < 1.5 and np.median(off) < 1e-9


def test_a_slit_opens_and_a_blade_thickens():
    """Two strips that meet in an edge, 10 degrees apart: seen from within the wedge, and from outside."""
    height = np.tan(np.radians(5))
    v = np.array([[0, 0, 0], [0, 1, 0], [1, 0.5, height], [1, 0.5, -height]])
    for triangles in (np.array([[0, 1, 2], [1, 0, 3]]), np.array([[1, 0, 2], [0, 1, 3]])):
        assert len(sharp(v, triangles)) == 1
        out = unfolded(v, triangles)
        assert len(sharp(out, triangles)) == 0
        assert out[2, 2] > height and out[3, 2] < -height
        np.testing.assert_array_equal(out[:2], v[:2])
