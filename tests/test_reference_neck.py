# SPDX-License-Identifier: GPL-3.0-or-later
"""Neck of the reference skin: larynx, suprasternal notch, sternocleidomastoid and collar bones show, softly."""

import numpy as np
import pytest

from headshop.assets.generators import skin_neck
from headshop.assets.generators.skin_finish import finish_shape
from headshop.assets.generators.skin_layout import skin_layout
from headshop.assets.generators.skin_shape import mean_shape
from headshop.sim.adapt.closest import Surface
from headshop.sim.health.cuts import smooth_skin
from headshop.sim.mesh import Mesh


@pytest.fixture(scope="module")
def grown():
    """Brush name -> mm by which the limit surface stands out along its line, against a head without the brushes."""
    layout = skin_layout()
    brushed = finish_shape(layout, mean_shape())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skin_neck, "BRUSHES", ())
        plain = finish_shape(layout, mean_shape())
    with_, without = (smooth_skin(Mesh(x, layout.faces)) for x in (brushed, plain))
    skin = Surface(with_.vertices, with_.triangles)
    out = {}
    for name, line, *_ in skin_neck.BRUSHES:
        start = Surface(without.vertices, without.triangles).closest(skin_neck._upright(np.array(line, float)))
        end = skin.closest(start.points)
        out[name] = float(((end.points - start.points) * start.normals).sum(axis=1).mean())
    edge = np.abs(brushed - plain)[layout.edge].max()
    far = np.linalg.norm(brushed - plain, axis=1).max()
    return out, edge, far


def test_what_stands_out_and_what_sinks_in_does(grown):
    for name, _, height, _ in skin_neck.BRUSHES:
        assert grown[0][name] * np.sign(height) > 0.3, name
    assert grown[0]["sternocleidomastoid"] > 1 and grown[0]["collar bone"] > 1
    assert grown[0]["suprasternal notch"] < -1 and grown[0]["thyroid cartilage"] > 1.5


def test_brushes_are_soft_and_leave_the_edge(grown):
    assert grown[1] == 0 and 2 < grown[2] < 9
