# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that falls on the forehead: it is left out, and the forehead below it is invented."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import skin_left
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.fringe import fit_without_fringe, fringe_zone, has_fringe, left_beside
from headshop.sim.landmarks.hair_rim import rim_of_hair
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish


@pytest.fixture(scope="module")
def fringed(grown, falling):
    """With a fringe of hair in tufts down to the brows."""
    return grown(falling, high=0.0, lowest=12.0)


def on_forehead(points, truth):
    """(n,) bool: which of ``points`` (n, 3) mm lie on the forehead, between the brows and the scalp."""
    _, y, z = points.T
    return (z > truth["sci_l"][2] + 3) & (z < truth["tr"][2]) & (y < truth["g"][1] + 40)


def test_a_fringe_is_left_out_and_the_forehead_below_it_invented(reference, fringed, monkeypatch, of_face, surface_of):
    scan, whole, truth = fringed
    bare = []
    monkeypatch.setattr(skin_left, "rim_of_hair", lambda *told: bare.append(told[-2]) or rim_of_hair(*told))
    scan, below = surface_of(scan), Surface(whole, reference.skin.triangles)
    look = finish(first_look(reference, scan, of_face(truth)))
    assert look.left_out["hair"] == pytest.approx(scan.area.sum() - look.target.area.sum())
    off = below.closest(scan.vertices, 60.0).distance
    kept = np.zeros(len(off), dtype=bool)
    kept[np.unique(cKDTree(scan.vertices).query(look.target.vertices)[1])] = True
    fallen = on_forehead(scan.vertices, truth) & (off > 2)
    assert kept[fallen].mean() < 0.05 and kept[off < 0.1].mean() > 0.97
    invented = below.closest(look.filled.vertices[on_forehead(look.filled.vertices, truth)], 60.0).distance
    assert invented.mean() < 3.5 and off[fallen].mean() > 6
    hidden = reference.landmarks.on({"skin": drawn(reference.skin.faces, reference.skin.vertices)})["tr"]
    near = np.argsort(np.linalg.norm(reference.skin.vertices - hidden, axis=1))[:8]
    assert np.isin(near, look.hidden).all(), "what is shown there is told to be no skin of the scan"
    space = shape_space(reference)
    assert bare[0][cKDTree(space.points).query(space.landmarks(space.points)["tr"])[1]], "it has no rim besides"


def test_landmarks_clicked_on_a_fringe_count_for_nothing(reference, fringed, of_face, surface_of):
    """And those that somebody knows below it do."""
    scan, _, truth = fringed
    scan, face = surface_of(scan), of_face(truth)
    outward = np.array([0.0, -1.0, 0.3]) / np.linalg.norm([0.0, -1.0, 0.3])
    ways = scan.vertices - truth["tr"]
    apart = np.linalg.norm(np.cross(ways, outward), axis=1)
    clicked = scan.vertices[np.where(ways @ outward > 5, apart, np.inf).argmin()]
    assert np.linalg.norm(clicked - truth["tr"]) < 15
    for place, counts in ((clicked, False), (truth["tr"], True)):
        look = finish(first_look(reference, scan, face | {"tr": place}))
        assert ("tr" in look.landmarks) == counts


def test_landmarks_under_a_fringe_hang_in_mid_air(reference, fringed):
    scan, _, truth = fringed
    found = finish(find_landmarks(scan, reference))
    assert {"tr", "ft_l", "ft_r"} <= set(found.mid_air) and not {"g", "n", "prn", "gn"} & set(found.mid_air)
    off = {n: np.linalg.norm(found.positions[n] - truth[n]) for n in ("ft_l", "ft_r", "sci_l", "sci_r", "g")}
    assert np.mean(list(off.values())) < 6.0


def test_who_wants_to_keep_hair_keeps_a_fringe(reference, fringed, of_face, surface_of):
    scan = surface_of(fringed[0])
    look = finish(first_look(reference, scan, of_face(fringed[2]), leave_out=("depth_jumps", "flat_ends")))
    assert look.target is scan and look.left_out["hair"] == 0


def test_a_fringe_is_what_is_rough_low_on_the_forehead_alone(reference, laid, grown, falling):
    space = shape_space(reference)
    rng = np.random.default_rng(0)
    shown = {
        "fringe": (falling, 12.0, 0.0),
        "noisy fringe": (falling, 12.0, 0.15),
        "high hairline": (falling, 35.0, 0.0),
        "hair": (falling, np.inf, 0.0),
        "noise": (lambda points: 0.0, np.inf, 0.6),
    }
    for name, (thick, lowest, noise) in shown.items():
        scan, whole, _ = grown(thick, high=0.0, lowest=lowest)
        points = scan.vertices + noise * rng.normal(size=scan.vertices.shape)
        fit = laid(space, whole[space.vertices])
        assert has_fringe(space, fit, Surface(points, scan.triangles)) == ("fringe" in name), name


def test_a_face_without_a_fringe_stays_as_it_was_laid(reference, shaggy, laid, surface_of):
    space = shape_space(reference)
    fit = laid(space, shaggy[1][space.vertices])
    again, covered = finish(fit_without_fringe(space, surface_of(shaggy[0]), fit))
    assert again is fit and not covered.any()


def test_a_fringe_falls_on_forehead_and_temples(reference):
    space = shape_space(reference)
    zone, marks = fringe_zone(space), space.landmarks(space.points)
    falls = {n for n, place in marks.items() if zone[cKDTree(space.points).query(place)[1]]}
    assert {"v", "op", "tr", "ft_l", "ft_r"} <= falls
    assert not {"n", "en_l", "ex_l", "or_l", "prn", "sto", "gn", "go_l", "t_l", "pa_l", "sa_l"} & falls


def test_what_is_worn_is_left_out_of_a_scan_with_its_fringe(reference):
    whole = Surface(reference.skin.vertices, reference.skin.triangles)
    under = np.zeros(len(whole.triangles), dtype=bool)
    under[::3] = True
    worn = np.zeros((~under).sum(), dtype=bool)
    worn[5:9] = True
    left = left_beside(whole, under, worn)
    given_up = np.flatnonzero(~under)[5:9]
    assert (left.triangles == np.delete(whole.triangles, given_up, axis=0)).all()
