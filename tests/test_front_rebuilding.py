# SPDX-License-Identifier: GPL-3.0-or-later
"""A head that is built again from its scan takes the place of the one before; modifiers of the scan count."""

import numpy as np
import pytest

from headshop.sim.progress import Progress


@pytest.fixture
def built(addon, scan_object, reference, monkeypatch):
    """``built()`` -> the skin of a head of the reference that *Build Head* makes of the scan, whose mesh is in ``built.of``."""
    from headshop.headshop_addon import heads, pipeline, scan_landmarks

    attributes = {
        "distance_mm": np.zeros(len(reference.skin.vertices)),
        "fitted": np.ones(len(reference.skin.vertices)),
    }

    def build(scan, landmarks, name, scan_object, scene, **_):
        yield Progress(0.5, "")
        make.of = scan.mesh
        collection = heads.create_head(reference, name, scan_object, scene=scene, attributes=attributes)
        skin = next(obj for obj in collection.objects if heads.is_skin(obj))
        return skin, {"fit": {"mean_mm": 0.1, "doubted_mm": {"ch_r": 19.0}}}

    def make():
        assert addon.ops.headshop.build_head() == {"FINISHED"}
        return addon.context.scene.headshop.head

    monkeypatch.setattr(pipeline, "build", build)
    scan_landmarks.replace(scan_object, reference.landmark_positions())
    return make


def test_the_head_before_is_hidden_and_said_to_be(built, reference, capfd):
    from headshop.headshop_addon import heads

    other = heads.create_head(reference, "Somebody")
    first, second = built(), built()
    said = capfd.readouterr().out
    assert "is hidden" in said and "check ch_r" in said
    assert heads.head_collection(first).hide_viewport and heads.head_collection(first).hide_render
    for collection in (heads.head_collection(second), other):
        assert not collection.hide_viewport and not collection.hide_render


def test_the_fit_is_shown_of_the_new_head_where_it_was_of_the_other(built):
    from headshop.headshop_addon import heat_map

    first = built()
    assert not first.headshop.show_fit
    first.headshop.show_fit = True
    second = built()
    assert second.headshop.show_fit and second.data.color_attributes.active_color.name == heat_map.ATTRIBUTE
    assert not first.headshop.show_fit and heat_map.ATTRIBUTE not in first.data.color_attributes
    second.headshop.show_fit = False
    assert not built().headshop.show_fit


@pytest.mark.parametrize("hidden", [False, True])
def test_modifiers_of_the_scan_count(built, scan_object, reference, hidden):
    from headshop.headshop_addon import bridge

    wave = scan_object.modifiers.new("Larger", "DISPLACE")
    wave.direction, wave.strength, wave.mid_level = "Z", 0.012, 0.0
    scan_object.hide_viewport = hidden
    scan_object.hide_set(hidden)
    np.testing.assert_allclose(bridge.scan_mesh(scan_object).vertices, reference.skin.vertices + [0, 0, 12], atol=1e-3)
    assert (scan_object.hide_viewport, scan_object.hide_get()) == (hidden, hidden)
    built()
    np.testing.assert_allclose(built.of.vertices, reference.skin.vertices + [0, 0, 12], atol=1e-3)
