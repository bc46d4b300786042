# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles that come out the same wherever their arrays lie in memory."""

import numpy as np
import pytest

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.pose import Pose, control
from headshop.sim.angles import bearing
from headshop.sim.cylindrical.range_map import resample
from headshop.sim.mesh import Mesh
from headshop.sim.tissue.frames import Frames
from headshop.sim.tissue.model import build_model


def test_bearings_are_angles_from_ahead():
    table = np.random.default_rng(3).normal(size=(50, 3))
    angle = bearing(table[:, 1], table[:, 2])
    far = np.hypot(table[:, 1], table[:, 2])
    assert np.abs(far * np.sin(angle) - table[:, 1]).max() < 1e-12
    assert np.abs(far * np.cos(angle) - table[:, 2]).max() < 1e-12
    assert float(bearing(1.0, 0.0)) == pytest.approx(np.pi / 2)
    assert (bearing(table[:, 1], table[:, 2]) == bearing(table[:, 1].copy(), table[:, 2].copy())).all()


def test_columns_of_a_table_are_copied_together(strided):
    table = np.ones((50, 3))
    bearing(table[:, 1], table[:, 2])
    assert not strided


def test_the_tissue_reckons_with_numbers_that_lie_together(strided, reference):
    model = build_model(reference)
    frames = Frames(model)
    for pose in (Pose(), expressions()["joy"], Pose(jaw_open=0.5, blink_l=1.0)):
        frames.follow(control(model, pose))
    assert not strided


def test_range_maps_reckon_with_numbers_that_lie_together(strided, reference):
    skin = reference.skin
    made = resample(Mesh(skin.vertices, skin.faces), width=64, height=32)
    made.texels(skin.vertices)
    assert not strided
