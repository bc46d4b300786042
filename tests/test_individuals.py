# SPDX-License-Identifier: GPL-3.0-or-later
"""Ten random individuals keep every number that the reference keeps."""

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.health.cuts import self_cuts, smooth_skin
from headshop.sim.health.numbers import LIMITS, numbers
from headshop.sim.scan.individual import individual

PEOPLE = 10


@pytest.fixture(scope="module")
def people(reference):
    return [individual(reference, np.random.default_rng(seed)) for seed in range(PEOPLE)]


@pytest.fixture(scope="module")
def found(reference, people):
    return [numbers(person, reference) for person in people]


@pytest.mark.parametrize("name", LIMITS)
def test_individuals_keep_their_numbers(found, name):
    wrong = {k: (n.values[name], n.details.get(name, "")) for k, n in enumerate(found) if name in n.faults()}
    assert not wrong, wrong


def test_individuals_differ_as_people_do(reference, people):
    """Face width and nose height spread as published; eyes and teeth go with the face, and are no copies."""
    wide = np.array([p.landmark_positions()["zy_l"][0] - p.landmark_positions()["zy_r"][0] for p in people])
    assert 2.5 < wide.std() < 11
    centres = np.array([p.eyes[0].centre for p in people])
    assert (centres.std(axis=0) > 0.3).all()
    assert np.ptp([p.eyes[0].radius for p in people]) > 0.05
    for part in ("teeth_upper", "tongue", "skull"):
        moved = [np.linalg.norm(p.parts[part].vertices - reference.parts[part].vertices, axis=1).mean() for p in people]
        assert min(moved) > 0.3, part


@pytest.mark.parametrize("opening", [0.5, 1.0])
def test_their_mouths_open_plainly_without_a_fold(people, opening):
    assert [self_cuts(smooth_skin(plainly_posed(person, jaw_open=opening).skin)) for person in people] == [0] * PEOPLE


def test_the_same_seed_makes_the_same_person(reference, people):
    again = individual(reference, np.random.default_rng(0))
    for part, mesh in again.parts.items():
        np.testing.assert_array_equal(mesh.vertices, people[0].parts[part].vertices, err_msg=part)
