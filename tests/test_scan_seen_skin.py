# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as it is seen: eyeballs between the lids, a film between open lips, no fold at the corners of mouth and lids."""

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.untangle import sharp
from headshop.sim.anatomy.eyeball import reach
from headshop.sim.anatomy.seen_skin import behind_lids, behind_lips, seen_skin
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_piercing import self_piercings
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.mesh_unfolding import unfolded
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply


def test_the_film_between_the_lids_lies_on_the_eyeball(reference):
    seen = seen_skin(reference)
    for eye, side in zip(reference.eyes, "lr", strict=True):
        film = seen.vertices[: len(reference.skin.vertices)][behind_lids(reference, side)] - eye.centre
        far = np.linalg.norm(film, axis=1)
        above = far - reach(eye, np.arccos(film @ eye.gaze / far))
        assert (film @ eye.gaze > 0).all() and -0.01 < above.min() and above.max() < 2.5
        assert np.median(above) < 0.3


def mouth(head):
    """What is seen of the lining of a head's mouth, and of its lips; what it has of lips."""
    seen = seen_skin(head).vertices[: len(head.skin.vertices)]
    lips = np.maximum(*(np.asarray(head.groups[f"lip_{x}"]) for x in ("upper", "lower"))) > 0.5
    return seen[behind_lips(head)], seen[lips & ~behind_lips(head)], head.skin.vertices[lips & ~behind_lips(head)]


@pytest.mark.parametrize("opening", [0.3, 0.8])
def test_open_lips_have_a_film_between_them(reference, opening):
    posed = plainly_posed(reference, jaw_open=opening)
    film, lips, made = mouth(posed)
    for side in (film.min(axis=0) - lips.min(axis=0), lips.max(axis=0) - film.max(axis=0)):
        assert side[0] > 0 and side[2] > 0  # within their outline as seen from in front
    assert np.linalg.norm(lips - made, axis=1).max() < 1.5
    depth = posed.skin.vertices[behind_lips(posed)][:, 1]
    assert np.ptp(film[:, 1]) < 20 < 40 < np.ptp(depth)
    seen = seen_skin(posed)
    assert len(sharp(seen.vertices, seen.triangles)) == len(self_piercings(seen.vertices, seen.triangles)) == 0


def test_behind_shut_lips_the_lining_stays(reference):
    film, _, _ = mouth(reference)
    drawn = smoother(reference.skin.faces, len(reference.skin.vertices))[0] @ reference.skin.vertices
    lining = drawn[: len(reference.skin.vertices)][behind_lips(reference)]
    assert np.median(np.linalg.norm(film - lining, axis=1)) < 1e-9 and np.ptp(film[:, 1]) > 40


def as_scanned(reference, scan, marks):
    """A head built with all that its scan shows, and that scan."""
    scan = clean_scan(read_ply(scan))[0]
    return finish(build_head(reference, scan, read_landmarks(marks), detail=0, relax="never", leave_out="never")), scan


def test_a_head_kept_as_scanned_lies_on_a_scan_that_ends_flat_and_holds_a_tube(reference, shared):
    at = shared / "ct_headsq"
    built, _ = as_scanned(reference, at / "skin.ply", at / "skin.landmarks.json")
    assert built.fit["mean_mm"] < 0.2 and built.fit["p95_mm"] < 0.6


def test_between_the_parted_lips_of_a_head_kept_as_scanned_the_film_is_near_the_scan(reference, shared):
    at = shared / "ict" / "examples"
    built, scan = as_scanned(reference, at / "s1_smile_scan.ply", at / "s1_smile_truth.json")
    film, _, _ = mouth(built.head)
    off = Surface(scan.vertices, scan.triangles).closest(film).distance
    assert np.median(off) < 4 and off.max() < 8  # teeth lie behind lips
    assert np.ptp(built.head.skin.vertices[behind_lips(built.head)][:, 1]) > 40


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
