# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids, shut or open, are told from the scan where the landmarks given say nothing of them."""

import numpy as np
import pytest

from headshop.sim.adapt import build
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish

TWELVE = ("n", "prn", "sn", "en_l", "en_r", "ex_l", "ex_r", "ch_l", "ch_r", "gn", "t_l", "t_r")
LIDS = ("ps_l", "pi_l", "ps_r", "pi_r")


class SeenError(Exception):
    """What was to be seen was seen."""


def told_of(reference, target, given):
    """The landmarks after a first look."""
    return finish(first_look(reference, target, given)).landmarks


@pytest.fixture(scope="module")
def scans(seen_skin):
    """Sides of shut eyes -> landmarks, and the skin as a scanner sees it."""
    return {sides: seen_skin(sides)[::-1] for sides in ((), ("l", "r"))}


def test_lids_that_meet_are_told_and_where(reference, scans):
    marks, target = scans["l", "r"]
    told = told_of(reference, target, {name: marks[name] for name in TWELVE})
    assert set(told) == {*TWELVE, *LIDS}
    for side in "lr":
        np.testing.assert_array_equal(told[f"ps_{side}"], told[f"pi_{side}"])
        assert np.linalg.norm(told[f"ps_{side}"] - (marks[f"ps_{side}"] + marks[f"pi_{side}"]) / 2) < 4


def test_margins_of_open_lids_are_told(reference, scans):
    marks, target = scans[()]
    told = told_of(reference, target, {name: marks[name] for name in TWELVE})
    assert set(told) == {*TWELVE, *LIDS}
    assert all(abs(told[name] - marks[name])[2] < 1.8 for name in LIDS)


def test_lids_that_are_given_stay_as_they_are(reference, scans):
    marks, target = scans["l", "r"]
    every = {name: marks[name] for name in (*TWELVE, *LIDS)}
    assert told_of(reference, target, every) == every
    one = {name: marks[name] for name in (*TWELVE, "ps_l")}
    assert set(told_of(reference, target, one)) == {*one, "ps_r", "pi_r"}


def test_where_no_face_lies_nothing_is_told(reference, scans):
    marks, target = scans["l", "r"]
    away = {name: marks[name] + [0, 4000, 0] for name in TWELVE}
    assert told_of(reference, target, away) == away


def test_a_head_is_built_with_the_lids_that_were_told(reference, scans, monkeypatch):
    marks, target = scans["l", "r"]
    fitted_to = []

    def fit_skin(_, __, given, *___):
        fitted_to.append(given)
        raise SeenError
        yield

    monkeypatch.setattr(build, "fit_skin", fit_skin)
    scan = Mesh.from_triangles(target.vertices, target.triangles)
    with pytest.raises(SeenError):
        finish(build.build_head(reference, scan, {name: marks[name] for name in TWELVE}))
    assert set(fitted_to[0]) == {*TWELVE, *LIDS}
