# SPDX-License-Identifier: GPL-3.0-or-later
"""Twelve landmarks and a plausible head laid on the scan tell about where all others are."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.completion import complete_positions
from headshop.sim.adapt.ears import EAR_MARKS
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.first_look import UNTOLD, first_look
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.progress import finish

TWELVE = [*(f"{mark}_{side}" for mark in ("en", "ex", "ch", "al", "t") for side in "lr"), "prn", "gn"]


@pytest.fixture(scope="module")
def person(reference):
    """Somebody whole, with closed lips: the scan (a Surface) and all landmarks."""
    space = shape_space(reference)
    k = np.arange(space.modes.shape[2])
    skin = space.shaped(np.linalg.solve(np.eye(len(k)) + space.seal, np.where(k < 20, np.cos(2.0 * k), 0.0)))
    return Surface(skin, space.triangles), {n: p for n, p in space.landmarks(skin).items() if n in SKIN}


def test_all_others_are_guessed_nearer_than_a_warp_alone_carries_them(person, reference):
    scan, truth = person
    given = {n: truth[n] for n in TWELVE}
    look = finish(first_look(reference, scan, given))
    told = set(look.landmarks)
    assert set(look.guessed) == {n for n in truth if n not in told and n.partition("_")[0] not in UNTOLD}
    rest = reference.landmark_positions()
    carried = complete_positions({n: rest[n] for n in truth}, given)
    ours = [n for n in look.guessed if n.partition("_")[0] not in EAR_MARKS]
    guessed, warped = (
        np.mean([np.linalg.norm(places[n] - truth[n]) for n in ours]) for places in (look.guessed, carried)
    )
    assert guessed < 2.0 and guessed < 0.5 * warped


def test_guesses_of_an_ear_are_where_somebody_would_pick_them(person, reference):
    """On the rim of the scan's ear, as those that are given and found are: guessed inside of it, an adapted ear's rim came to
    lie in the scan's concha where ears are large for the head."""
    scan, truth = person
    look = finish(first_look(reference, scan, {n: truth[n] for n in TWELVE}))
    for name in (f"{mark}_{side}" for mark in ("sa", "sba", "pa", "obs") for side in "lr"):
        assert np.linalg.norm(look.guessed[name] - truth[name] - moved(name)) < 2.5, name
        assert np.linalg.norm(moved(name)) == 0 or np.linalg.norm(look.guessed[name] - truth[name]) > 3.0


def test_nothing_is_guessed_of_what_is_given(person, reference):
    scan, truth = person
    assert set(finish(first_look(reference, scan, truth)).guessed) == set()
