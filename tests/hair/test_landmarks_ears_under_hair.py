# SPDX-License-Identifier: GPL-3.0-or-later
"""Ears under hair: they are looked for below it, and told to be a guess."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.ears import EAR_MARKS
from headshop.sim.landmarks import find
from headshop.sim.landmarks import under_hair as under_hair_of
from headshop.sim.landmarks.confidence import judge_together
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.shape_fit import Expression
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import fit_under_hair
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish


def test_beside_an_ear_under_hair_the_other_must_be_found_better(reference, shaggy, laid, monkeypatch, surface_of):
    space = shape_space(reference)
    scan, fit = surface_of(shaggy[0]), laid(space, shaggy[1][space.vertices])
    for left, right, hidden in ((0.95, 0.89, ()), (0.5, 0.89, ("l", "r")), (0.5, 0.95, ("l",))):
        monkeypatch.setattr(
            under_hair_of, "ear_found", lambda *told, seen=(left, right): dict(zip("lr", seen, strict=True))[told[-1]]
        )
        assert finish(fit_under_hair(space, scan, fit, Expression())).hidden == hidden


@pytest.fixture(scope="module")
def one_ear(reference, shaggy):
    """`shaggy` with a lock over the left ear: a scan."""
    scan, whole, truth = shaggy
    near = cKDTree(whole[np.asarray(reference.groups["ear_l"]) > 0.3]).query(scan.vertices)[0]
    lock = np.clip((40 - near) / 15, 0, 1) * (scan.vertices[:, 1] > truth["t_l"][1] - 15)
    return Mesh.from_triangles(scan.vertices + [26.0, 0, 0] * lock[:, None], scan.triangles)


def test_hair_over_an_ear_hides_what_lies_about_it(reference, shaggy, one_ear, of_face, surface_of):
    """And what somebody says of an ear goes before that."""
    space, scan, truth = shape_space(reference), surface_of(one_ear), shaggy[2]
    ears = {s: space.vertices[(space.ear > 0.3) & ((space.points[:, 0] > 0) == (s == "l"))] for s in "lr"}
    given = {n: p for n, p in of_face(truth).items() if n.partition("_")[0] not in EAR_MARKS}
    look = finish(first_look(reference, scan, given))
    hidden = {s: np.isin(ears[s], look.hidden).mean() for s in "lr"}
    assert hidden["l"] > 0.8 and hidden["r"] < 0.05
    told = finish(first_look(reference, scan, of_face(truth)))
    assert np.isin(ears["l"], told.hidden).mean() < 0.05


def test_an_ear_under_hair_is_looked_for_below_it(reference, shaggy, one_ear, monkeypatch):
    """Taken for what can be seen, the hair would put it 15 mm off. What is found of it is not sure."""
    hidden = []
    monkeypatch.setattr(find, "judge_together", lambda *told: hidden.append(told[-1]) or judge_together(*told))
    truth, found = shaggy[2], finish(find_landmarks(one_ear, reference))
    assert hidden == [("l",)] and not any(f"{n}_l" in found.sure() for n in EAR_MARKS)
    off = {
        s: np.mean([np.linalg.norm(found.positions[f"{n}_{s}"] - truth[f"{n}_{s}"]) for n in EAR_MARKS]) for s in "lr"
    }
    assert off["l"] < 10 and off["r"] < 4


@pytest.fixture(scope="module")
def earless(reference, grown, shag):
    """Short hair in tufts, and locks over both ears: the scan, the skin below and its landmarks."""
    scan, whole, truth = grown(shag, high=0.0)
    points = scan.vertices.copy()
    for side, sign in (("l", 1.0), ("r", -1.0)):
        near = cKDTree(whole[np.asarray(reference.groups[f"ear_{side}"]) > 0.3]).query(scan.vertices)[0]
        lock = np.clip((40 - near) / 15, 0, 1) * (scan.vertices[:, 1] > truth[f"t_{side}"][1] - 15)
        points += [[sign * 26.0, 0, 0]] * lock[:, None]
    return Mesh.from_triangles(points, scan.triangles), whole, truth


def off_ears(positions, truth):
    """Side -> mm by which the landmarks of that ear are off."""
    return {s: np.mean([np.linalg.norm(positions[f"{n}_{s}"] - truth[f"{n}_{s}"]) for n in EAR_MARKS]) for s in "lr"}


def test_ears_under_hair_are_where_the_likeliest_head_has_them(reference, earless, of_face, surface_of):
    """The same in the landmarks found, in the first look at a scan with landmarks of the face, and where one ear is known."""
    scan, _, truth = earless
    found = finish(find_landmarks(scan, reference))
    assert max(off_ears(found.positions, truth).values()) < 9
    ears = {n for n in found.positions if n.partition("_")[0] in EAR_MARKS}
    assert not ears & set(found.sure())
    face = {n: p for n, p in of_face(truth).items() if n not in ears}
    looked = finish(first_look(reference, surface_of(scan), face))
    assert max(off_ears(looked.guessed, truth).values()) < 9
