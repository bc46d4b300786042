# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair: thick or rough, it takes neither ears nor the crown with it, and the scalp below it is invented."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.ears import EAR_MARKS
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks import filled_in
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.shape_fit import Expression
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import fit_under_hair, hair_over, in_face, under_hair
from headshop.sim.mesh import vertex_normals
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.sample import make_sample

THICK = 20.0  # mm


@pytest.fixture(scope="module")
def hairy(grown):
    """With thick hair, all of it combed."""
    return grown(lambda points: THICK)


def test_ears_are_found_below_thick_hair(hairy, reference):
    scan, _, truth = hairy
    found = finish(find_landmarks(scan, reference))
    ears = [n for n in SKIN if n.rpartition("_")[0] in EAR_MARKS]
    off = [np.linalg.norm(found.positions[n] - truth[n]) for n in ears if n in found.positions]
    assert len(off) > len(ears) / 2
    assert np.mean(off) < 7.0
    crown = found.positions["v"][2]
    assert truth["v"][2] - 10 < crown < truth["v"][2] + THICK + 3


def test_a_head_with_thick_hair_has_a_whole_crown(hairy, reference, of_face):
    """Without landmarks of the skull, which hair hides, the crown is neither cut off nor dented."""
    scan, _, truth = hairy
    head = finish(build_head(reference, scan, of_face(truth), detail=0)).head
    skin = head.skin
    top = drawn(skin.faces, skin.vertices)[:, 2].max()
    assert truth["v"][2] - 8 < top < truth["v"][2] + THICK + 3


def test_hair_grows_on_scalp_and_nape_only(reference):
    space = shape_space(reference)
    marks = space.landmarks(space.points)
    near = cKDTree(space.points).query([marks[n] for n in marks])[1]
    grows = {n for n, k in zip(marks, near, strict=True) if space.hairy[k]}
    assert {"v", "op"} <= grows
    bare = {n for n in marks if n.rpartition("_")[0] in EAR_MARKS} | {"g", "n", "prn", "sto", "gn", "zy_l", "zy_r"}
    assert not grows & bare


@pytest.mark.parametrize("kind", ["hairy", "shaggy"])
def test_hair_is_left_out_and_the_face_is_not(kind, reference, request, of_face, surface_of, short):
    scan, whole, truth = request.getfixturevalue(kind)
    scan = surface_of(scan)
    look = finish(first_look(reference, scan, of_face(truth)))
    assert look.left_out["hair"] == pytest.approx(scan.area.sum() - look.target.area.sum())
    off = Surface(whole, reference.skin.triangles).closest(scan.vertices, 60.0).distance
    kept = np.zeros(len(off), dtype=bool)
    kept[np.unique(cKDTree(scan.vertices).query(look.target.vertices)[1])] = True
    assert kept[off < 0.1].mean() > 0.97  # skin
    assert kept[off > 0.8 * short].mean() < 0.3  # hair


def test_little_of_the_step_where_hair_begins_is_taken_for_forehead(reference, grown, shag, of_face, surface_of):
    """It became bumps. By the outline of the face alone a quarter of what stands off by more than 6 mm would stay."""
    scan, whole, truth = grown(shag, high=0.0)
    scan = surface_of(scan)
    look = finish(first_look(reference, scan, of_face(truth)))
    off = Surface(whole, reference.skin.triangles).closest(scan.vertices, 60.0).distance
    kept = np.isin(np.arange(len(off)), cKDTree(scan.vertices).query(look.target.vertices)[1])
    front = (scan.vertices[:, 1] < truth["t_l"][1] - 10) & (scan.vertices[:, 2] > truth["g"][2])
    assert kept[front & (off > 6)].mean() < 0.08 and kept[front & (off < 0.1)].mean() > 0.98


def test_scalp_under_hair_is_filled_in_where_it_is_told_to_be(reference, shaggy, monkeypatch, of_face, surface_of):
    scan, _, truth = shaggy
    told = []

    def raised(space, hair, covered, given):
        told.append((covered, given))
        return replace(hair.scalp, points=hair.scalp.points + [0.0, 0.0, 40.0])

    monkeypatch.setattr(filled_in, "scalp_by_face", raised)
    given = of_face(truth)
    look = finish(first_look(reference, surface_of(scan), given))
    assert look.filled.vertices[:, 2].max() > truth["v"][2] + 20
    assert told[0][0].any() and told[0][1].keys() == given.keys()


def test_a_picked_back_of_the_head_is_heeded_where_hair_is_seen_elsewhere(reference, shaggy, of_face):
    scan, _, truth = shaggy
    behind = truth["t_l"][1] + 40
    shown = ~(scan.vertices[scan.triangles][:, :, 1] > behind).any(axis=1)
    scan = Surface(scan.vertices, scan.triangles[shown], smooth=2.0)
    assert scan.vertices[:, 1].max() < truth["op"][1] - 20

    def ends(**more):
        look = finish(first_look(reference, scan, of_face(truth) | more))
        assert look.left_out["hair"] > 0
        return look.filled.vertices[np.abs(look.filled.vertices[:, 2] - truth["op"][2]) < 25][:, 1].max()

    place = truth["op"] + [0.0, 15.0, 0.0]
    assert ends(op=place) == pytest.approx(place[1], abs=5.0)
    assert ends(op=place) > ends() + 8


def test_a_bald_head_is_kept_whole(reference, grown, of_face, surface_of):
    scan, _, truth = grown(lambda points: 0.0)
    scan = surface_of(scan)
    look = finish(first_look(reference, scan, of_face(truth)))
    assert look.target is scan and look.filled is scan and look.left_out["hair"] == 0


def test_who_wants_to_keep_hair_does(reference, shaggy, of_face, surface_of):
    scan = surface_of(shaggy[0])
    look = finish(
        first_look(reference, scan, of_face(shaggy[2]), leave_out=("depth_jumps", "flat_ends", "held_by_lips"))
    )
    assert look.target is scan and look.filled is scan and look.left_out["hair"] == 0


def test_the_scalp_under_hair_is_invented_where_it_probably_is(reference, shaggy, of_face, short):
    scan, whole, truth = shaggy
    built = finish(build_head(reference, scan, of_face(truth), detail=0))
    skin = built.head.skin
    scalp = reference.groups["scalp"] > 0.9
    below = Surface(whole, reference.skin.triangles)
    places = drawn(skin.faces, skin.vertices)
    off = below.closest(places[scalp], 60.0).distance
    assert off.mean() < 0.75 * short and np.percentile(off, 95) < 12.0  # a higher skull than a face lets expect
    # It is smooth, as scalps are and hair is not.
    normals = vertex_normals(places, skin.triangles)[scalp]
    near = cKDTree(places[scalp]).query(places[scalp], 5)[1]
    rough = np.degrees(np.arccos(np.clip((normals[near[:, 1:]] * normals[:, None]).sum(axis=2), -1, 1))).mean()
    real = vertex_normals(whole, skin.triangles)[scalp]
    assert rough < 1.3 * np.degrees(np.arccos(np.clip((real[near[:, 1:]] * real[:, None]).sum(axis=2), -1, 1))).mean()
    assert built.attributes["fitted"][scalp].mean() < 0.2
    hidden = built.attributes["hidden"]
    assert hidden.dtype == bool and hidden[scalp].mean() > 0.8
    assert not hidden[np.linalg.norm(places - truth["prn"], axis=1) < 60].any()
    assert "left out: hair;" in built.fit["sentence"] and "scalp" in built.fit["sentence"]
    face = (reference.groups["face"] > 0.5) & (reference.groups["inner"] < 0.5)
    assert below.closest(places[face]).distance.mean() < 0.3


def test_below_thick_hair_a_usual_skull_is_found(reference, grown, of_face, surface_of):
    """A fit as close to the hair as to the face would put it 9 mm too high."""
    scan, whole, truth = grown(lambda points: THICK, high=0.0)
    look = finish(first_look(reference, surface_of(scan), of_face(truth)))
    crown = look.filled.vertices[look.filled.vertices[:, 2] > truth["t_l"][2] + 60]
    off = Surface(whole, reference.skin.triangles).closest(crown, 60.0).distance
    assert off.mean() < 0.25 * THICK


def test_smooth_hair_behind_rough_hair_is_hair_where_it_stands_off(reference, laid, grown, falling, surface_of):
    space = shape_space(reference)
    behind = space.landmarks(space.points)["t_l"][1] + 30

    def combed_back(points):
        return np.where(points[:, 1] < behind, falling(points), 8.0)

    scan, whole, _ = grown(combed_back, high=0.0)
    hair = finish(fit_under_hair(space, surface_of(scan), laid(space, whole[space.vertices]), Expression()))
    # Told by roughness alone: .17 of it.
    assert hair.covered[space.hairy & (space.points[:, 1] > behind + 10)].mean() > 0.4
    assert not hair.covered[(space.face > 0.9) & (space.points[:, 2] < 30)].any()


def test_the_face_is_no_hair(reference, laid):
    space = shape_space(reference)
    marks = space.landmarks(space.points)
    inside = in_face(space, laid(space, space.points), {}, 3.0)
    near = {n: inside[cKDTree(space.points).query(place)[1]] for n, place in marks.items()}
    assert all(near[n] for n in ("g", "prn", "sto", "pg", "or_l", "or_r", "ft_l"))
    assert not any(near[n] for n in ("v", "op", "eu_l", "t_l", "pa_r"))
    given = {"tr": marks["tr"] - [0, 0, 40]}  # hair begins at the brows
    lost = inside & ~in_face(space, laid(space, space.points), given, 3.0)
    assert lost.any() and space.points[lost, 2].mean() > marks["g"][2]


def test_a_noisy_scan_of_a_bald_head_shows_no_hair(reference, laid, grown, surface_of):
    """Roughness counts only against that of the same scan's forehead."""
    space = shape_space(reference)
    scan, whole, _ = grown(lambda points: 0.0)
    fit = laid(space, whole[space.vertices])
    rng = np.random.default_rng(0)
    dark = scan.vertices[:, 2] > whole[:, 2].max() - 70
    for noise, darker in ((0.0, 1), (0.3, 1), (0.6, 1), (0.1, 3)):
        spread = noise * np.where(dark, darker, 1)  # scanners see dark skin with more noise
        points = scan.vertices + spread[:, None] * rng.normal(size=scan.vertices.shape)
        covered = under_hair(space, fit, Surface(points, scan.triangles))
        assert not covered.any() and not hair_over(space, fit, surface_of(scan), covered).any()


def test_the_sample_shows_no_hair(reference, of_face, surface_of):
    """Its scanner sees the shadow of shaved hair with much noise."""
    sample = finish(make_sample(levels=2))
    scan = surface_of(clean_scan(sample.scan)[0])
    look = finish(first_look(reference, scan, of_face(sample.landmarks)))
    assert look.left_out["hair"] == 0
