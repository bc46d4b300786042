# SPDX-License-Identifier: GPL-3.0-or-later
"""Every number a reference head must keep, measured on the shipped file; and each measure finds what it looks for."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.anatomy.storage import load_head
from headshop.sim.health import cuts, eyes, mouth, texture, topology
from headshop.sim.health.bone import bone_cover
from headshop.sim.health.muscles import muscle_room
from headshop.sim.health.numbers import LIMITS, numbers
from headshop.sim.mesh_piercing import piercings, self_piercings


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def found(head):
    return numbers(head, head)


@pytest.mark.parametrize("name", LIMITS)
def test_the_reference_keeps_its_numbers(found, name):
    assert name not in found.faults(), (found.values[name], found.details.get(name, ""))


def test_the_skin_is_its_own_mirror_image(head):
    assert topology.mirror_error(head.skin) == (0.0, 0)
    bent = head.skin.moved(head.skin.vertices + [0.0, 0.0, 1e-3] * (head.skin.vertices[:, :1] > 1))
    assert topology.mirror_error(bent)[0] > 1e-4


def test_piercing_is_told_exactly():
    flat = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0.0]])
    through = np.array([[2, 2, -3], [3, 2, 3], [2, 3, 3.0]])
    one = np.array([[0, 1, 2]])
    both = np.arange(6).reshape(2, 3)
    assert len(piercings(flat, one, through, one)) == 1 == len(self_piercings(np.concatenate([flat, through]), both))
    assert len(piercings(flat, one, through + [20, 0, 0], one)) == 0
    assert len(piercings(flat, one, through + [0, 0, 3], one)) == 0  # it touches
    # a fan folded through itself shares a corner, not a side
    fan = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [5, 5, -2], [4, 4, 2.0]])
    assert len(self_piercings(fan, np.array([[0, 1, 2], [0, 3, 4]]))) == 1
    assert len(self_piercings(fan, np.array([[0, 1, 2], [0, 1, 4]]))) == 0


def test_a_lip_through_the_other_is_found(head):
    pushed = head.skin.vertices.copy()
    pushed[head.groups["lip_upper"] > 0.5] += [0, 2.0, -8.0]
    assert cuts.self_cuts(head.skin.moved(pushed)) > 20


def test_faults_of_every_kind_are_found(head):
    skin = head.skin.vertices
    shifted = head.with_vertices({"skin": skin + [0, 3.0, 0]})
    assert min(eyes.lid_gaps(shifted, "l").min(), eyes.lid_gaps(shifted, "r").min()) < -1
    assert mouth.outside_bag(shifted, "teeth_upper") > 100
    assert bone_cover(shifted, "skull")[0] < 1 and muscle_room(shifted)
    far = head.with_vertices({"skin": skin - [0, 30.0, 0]})
    assert cuts.cuts(far) and bone_cover(far, "skull")[2] > 100
    tall = head.parts["teeth_lower"].vertices * [1, 1, 1.1]
    assert mouth.rigidity(head.with_vertices({"teeth_lower": tall}), head, "teeth_lower") > 0.1
    ball = head.parts["eye_l"].vertices * [1, 1, 1.01]
    assert eyes.roundness(head.with_vertices({"eye_l": ball}), "l") > 0.05
    uv = head.skin.uv.copy()
    uv[7] = uv[300]
    assert texture.uv_overlap(replace(head.skin, uv=uv))[0] > 0
    assert texture.uv_overlap(replace(head.skin, uv=head.skin.uv[:, ::-1]))[1] > 0
