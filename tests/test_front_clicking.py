# SPDX-License-Identifier: GPL-3.0-or-later
"""What clicking landmarks shows and hides, what it leaves out, and what ends it; without a window."""

from types import SimpleNamespace

import numpy as np
import pytest


@pytest.fixture
def clicks(addon, scan_object):
    """The operator's methods on an object of Python's own, begun on the scan; ``said`` is what it reported."""
    from headshop.operators import click_landmarks

    methods = vars(click_landmarks.HEADSHOP_OT_click_landmarks)
    methods = {name: item for name, item in methods.items() if callable(item)}
    out = type("Clicks", (), methods)()
    out.said = []
    out.report = lambda kind, text: out.said.append(text)
    out._scan, out._steps, out._skipped, out._chosen, out.start = scan_object, [], [], None, ""
    return out


@pytest.fixture
def context(addon):
    """Blender's context with a window that shows nothing."""
    nothing = SimpleNamespace(cursor_modal_restore=lambda: None, status_text_set=lambda _: None)
    there, area = (
        addon.context,
        SimpleNamespace(type="VIEW_3D", header_text_set=lambda _: None, tag_redraw=lambda: None),
    )
    screen = SimpleNamespace(areas=[area])
    return SimpleNamespace(
        scene=there.scene,
        mode="OBJECT",
        area=area,
        screen=screen,
        space_data=SimpleNamespace(local_view=None),
        window=nothing,
        window_manager=SimpleNamespace(windows=[SimpleNamespace(screen=screen)]),
        workspace=nothing,
        view_layer=there.view_layer,
    )


def _press(key, **more):
    return SimpleNamespace(type=key, value="PRESS", **({"ctrl": False, "oskey": False} | more))


def test_the_head_gives_way_to_its_scan_and_comes_back(clicks, context, reference):
    from headshop.headshop_addon import heads

    collection = heads.create_head(reference, "Ref", clicks._scan)
    other = heads.create_head(reference, "Other")
    for there in clicks._scan.users_collection:  # as heads that were built without a window have it
        if there != collection:
            there.objects.unlink(clicks._scan)
    hidden = [obj.name for obj in collection.all_objects if obj.hide_viewport]
    before = {obj.hide_viewport for obj in other.all_objects}
    clicks._scan.hide_viewport = True
    clicks._scan.hide_set(True)
    clicks._show_alone(context)
    assert not clicks._scan.hide_viewport and not clicks._scan.hide_get()
    own, others = ({obj.hide_viewport for obj in c.all_objects if obj != clicks._scan} for c in (collection, other))
    assert clicks._scan.visible_get() and own == {True} and others == before
    clicks._finish(context)
    assert clicks._scan.hide_viewport
    assert [obj.name for obj in collection.all_objects if obj.hide_viewport] == hidden + [clicks._scan.name]


def test_what_an_artist_keeps_beside_a_head_stays_shown(clicks, context, reference, addon):
    from headshop.headshop_addon import heads

    made, hero = heads.create_head(reference, "Ref", clicks._scan), addon.data.collections.new("Hero")
    skin, lamp = next(filter(heads.is_skin, made.objects)), addon.data.objects.new("Lamp", None)
    context.scene.collection.children.link(hero)
    made.objects.unlink(skin)
    for obj in (skin, lamp):
        hero.objects.link(obj)
    clicks._show_alone(context)
    assert skin.hide_viewport and not lamp.hide_viewport and clicks._scan.visible_get()
    clicks._finish(context)
    assert not skin.hide_viewport


def test_a_scan_without_a_head_stays_shown(clicks, context):
    clicks._scan.hide_viewport = True
    clicks._show_alone(context)
    clicks._finish(context)
    assert not clicks._scan.hide_viewport


@pytest.mark.parametrize("key", ["X", "DEL"])
def test_a_landmark_is_left_out_and_taken_back(clicks, context, reference, key):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    scan_landmarks.replace(clicks._scan, truth, dict.fromkeys(truth, 0.9))
    clicks._show_alone(context)
    clicks._ask(context)
    name, before = clicks._name, scan_landmarks.snapshot(clicks._scan)
    assert clicks.modal(context, _press(key)) == {"RUNNING_MODAL"}
    assert name not in scan_landmarks.to_build(clicks._scan) and clicks._name != name
    assert name in scan_landmarks.positions(clicks._scan, "DERIVED")
    clicks.modal(context, _press("Z", ctrl=True))
    assert scan_landmarks.snapshot(clicks._scan) == before and name in scan_landmarks.to_build(clicks._scan)


def test_clicking_ends_where_the_scan_is_deleted_or_edited(clicks, context, addon):
    clicks._show_alone(context)
    clicks._name = "prn"
    context.mode = "EDIT_MESH"
    assert clicks.modal(context, _press("LEFTMOUSE")) == {"FINISHED"} and "being edited" in clicks.said[-1]
    context.mode = "OBJECT"
    addon.data.objects.remove(clicks._scan)
    assert clicks.modal(context, _press("LEFTMOUSE")) == {"FINISHED"} and len(clicks.said) == 2


@pytest.mark.parametrize("key", ["PAGE_DOWN", "S"])
def test_the_head_is_back_before_the_file_is_saved_or_another_workspace_shown(clicks, context, reference, key):
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Ref", clicks._scan)
    (skin,) = heads.find_heads()
    clicks._before, clicks._name = None, "prn"
    clicks._show_alone(context)
    assert clicks.modal(context, _press(key)) == {"PASS_THROUGH"} and skin.hide_viewport
    assert clicks.modal(context, _press(key, ctrl=True)) == {"FINISHED", "PASS_THROUGH"} and not skin.hide_viewport


def test_clicking_ends_where_the_scan_is_hidden(clicks, context):
    clicks._covered, clicks._name = [], "prn"
    clicks._scan.hide_set(True)
    assert clicks.modal(context, _press("LEFTMOUSE")) == {"FINISHED"} and "hidden" in clicks.said[-1]


def test_a_scan_in_an_excluded_collection_is_not_clicked(clicks, context, addon):
    collection, top = addon.data.collections.new("Scans"), context.scene.collection
    top.children.link(collection)
    top.objects.unlink(clicks._scan)
    collection.objects.link(clicks._scan)
    context.view_layer.layer_collection.children["Scans"].exclude = True
    assert clicks.invoke(context, _press("LEFTMOUSE")) == {"CANCELLED"}
    assert clicks.said == [f"{clicks._scan.name} is in a collection that is hidden or excluded: show that first."]


def test_the_scan_comes_into_local_view(clicks, context):
    entered = []
    context.view_layer.update()
    clicks._scan = SimpleNamespace(name=clicks._scan.name, hide_viewport=True, hide_set=lambda _: None)
    clicks._scan.local_view_set = lambda *how: entered.append(how)
    clicks._show_alone(context)
    assert not entered
    context.space_data.local_view = context.space_data
    clicks._show_alone(context)
    assert entered == [(context.space_data, True)]


def test_it_does_not_begin_in_edit_mode(addon, scan_object):
    addon.context.view_layer.objects.active = scan_object
    assert addon.ops.headshop.click_landmarks.poll()
    addon.ops.object.mode_set(mode="EDIT")
    assert not addon.ops.headshop.click_landmarks.poll()
    addon.ops.object.mode_set(mode="OBJECT")


def test_one_landmark_is_left_out_by_a_button(addon, scan_object, reference):
    from headshop.headshop_addon import scan_landmarks

    scan_landmarks.replace(scan_object, reference.landmark_positions())
    assert addon.ops.headshop.clear_landmarks(name="ch_r") == {"FINISHED"}
    assert set(reference.landmark_positions()) - set(scan_landmarks.to_build(scan_object)) == {"ch_r"}
    off = scan_landmarks.positions(scan_object, "DERIVED")["ch_r"] - reference.landmark_positions()["ch_r"]
    assert np.linalg.norm(off) < 3.0
    with pytest.raises(RuntimeError, match="There is no landmark 'nose'"):
        addon.ops.headshop.clear_landmarks(name="nose")
    assert addon.ops.headshop.clear_landmarks() == {"FINISHED"} and not scan_landmarks.to_build(scan_object)
