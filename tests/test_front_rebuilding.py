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


def test_the_head_before_is_hidden_and_said_to_be(addon, built, reference, capfd):
    from headshop.headshop_addon import heads

    other = heads.create_head(reference, "Somebody")
    first, second = built(), built()
    said = capfd.readouterr().out
    assert "is hidden" in said and "check ch_r" in said
    shown = addon.context.view_layer.layer_collection.children
    old = heads.head_collection(first)
    assert shown[old.name].hide_viewport and old.hide_render
    for collection in (heads.head_collection(second), other):
        assert not shown[collection.name].hide_viewport and not collection.hide_render
    addon.context.view_layer.update()
    assert not first.visible_get()
    shown[old.name].hide_viewport = False  # its eye in the outliner brings it back
    addon.context.view_layer.update()
    assert first.visible_get()


def test_a_head_that_an_artist_keeps_elsewhere_is_hidden_and_nothing_else(built, addon, scan_object):
    from headshop.headshop_addon import heads

    first, scene = built(), addon.context.scene
    hero, lamp = addon.data.collections.new("Hero"), addon.data.objects.new("Lamp", None)
    scene.collection.children.link(hero)
    hero.objects.link(lamp)
    heads.head_collection(first).objects.unlink(first)
    hero.objects.link(first)
    scan_object.hide_viewport = False
    second = built()
    addon.context.view_layer.update()
    assert lamp.visible_get() and not hero.hide_viewport and not hero.hide_render
    assert not any(obj.visible_get() for obj in heads.stands_with(first)) and first.hide_render
    addon.data.collections.remove(heads.head_collection(second))  # as an artist dissolves it in the outliner
    for obj in heads.parts_of(second).values():
        scene.collection.objects.link(obj)
    assert heads.head_collection(second) is None
    third = built()
    addon.context.view_layer.update()
    assert third.visible_get() and lamp.visible_get() and not any(o.visible_get() for o in heads.stands_with(second))


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


def test_modifiers_of_the_scan_count(built, scan_object, reference):
    _make_larger(scan_object)
    built()
    np.testing.assert_allclose(built.of.vertices, reference.skin.vertices + [0, 0, 12], atol=1e-3)


def test_modifiers_of_a_hidden_scan_count(addon, scan_object, reference, tmp_path):
    """In a file that was opened with the scan hidden, Blender leaves its modifiers out."""
    from headshop.headshop_addon import bridge

    _make_larger(scan_object)
    scan_object.hide_viewport = True
    scan_object.hide_set(True)
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "hidden.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "hidden.blend"))
    scan = addon.context.scene.headshop.scan
    np.testing.assert_allclose(bridge.scan_mesh(scan).vertices, reference.skin.vertices + [0, 0, 12], atol=1e-3)
    assert scan.hide_viewport and scan.hide_get()


def _make_larger(scan):
    wave = scan.modifiers.new("Larger", "DISPLACE")
    wave.direction, wave.strength, wave.mid_level = "Z", 0.012, 0.0


def test_the_collection_of_a_head_that_was_built_before_these_were_marked_is_known_by_its_name(addon, reference):
    from headshop.headshop_addon import heads

    collection = heads.create_head(reference, "Somebody")
    del collection[heads.PART]
    (skin,) = heads.find_heads()
    assert heads.head_collection(skin) == collection
    collection.name = "Hero"
    assert heads.head_collection(skin) is None
