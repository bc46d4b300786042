# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes, teeth and tongue of the reference head."""

import numpy as np
import pytest

from headshop.sim.anatomy.head import MATERIALS
from headshop.sim.anatomy.inside import inside, winding_number
from headshop.sim.anatomy.storage import load_head
from headshop.sim.health.topology import closed, volume


@pytest.fixture(scope="module")
def head():
    return load_head()


def outer_skin(head):
    """Triangles of the skin without the lining of mouth, nose and lids."""
    return head.skin.triangles[head.groups["inner"][head.skin.triangles].max(axis=1) < 0.5]


@pytest.mark.parametrize("part", ["eye_l", "eye_r"])
def test_parts_are_closed_and_dressed(head, part):
    mesh = head.parts[part]
    assert closed(mesh) and volume(mesh) > 0
    assert set(np.unique(mesh.material)) == set(range(len(MATERIALS[part])))


@pytest.mark.parametrize("part", ["eye_l", "eye_r"])
def test_parts_hide_behind_the_skin(head, part):
    # the eyes are open
    assert (winding_number(head.parts[part].vertices, head.skin.vertices, outer_skin(head)) > 0.05).all()


def test_sides_mirror(head):
    np.testing.assert_allclose(head.parts["eye_l"].vertices * [-1, 1, 1], head.parts["eye_r"].vertices, atol=1e-9)


def test_eyes_touch_the_lids_and_look_ahead(head):
    for eye, side in zip(head.eyes, "lr", strict=True):
        assert 11 < eye.radius < 13
        np.testing.assert_allclose(eye.gaze, [0, -1, 0])
        mesh = head.parts[f"eye_{side}"]
        pupil = mesh.vertices[np.unique(mesh.faces[mesh.material == 2][:, :3])].mean(axis=0)
        assert (pupil - eye.centre) @ eye.gaze > 0.7 * eye.radius
        lids = head.groups[f"lid_upper_{side}"] + head.groups[f"lid_lower_{side}"] > 0.5
        distance = np.linalg.norm(head.skin.vertices[lids] - eye.centre, axis=1)
        assert -0.2 < distance.min() - eye.radius < 1.0


def test_tongue_rests_within_the_lower_row(head):
    tongue, lower, upper = (head.parts[p] for p in ("tongue", "teeth_lower", "teeth_upper"))
    for row in (lower, upper):
        assert not inside(tongue.vertices, row.vertices, row.triangles).any()
    assert np.abs(tongue.vertices[:, 0]).max() < np.abs(lower.vertices[:, 0]).max()
    assert tongue.vertices[:, 1].min() > lower.vertices[:, 1].min()
