# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling brings all buttons, disabling leaves nothing, and a failure in between leaves nothing either."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _traces(bpy) -> dict:
    """Everything of ours that Blender holds."""
    handlers = bpy.app.handlers
    return {
        "classes": [name for name in dir(bpy.types) if "HEADSHOP" in name.upper()],
        "properties": [
            f"{owner.__name__}.{name}"
            for owner in (
                bpy.types.Object,
                bpy.types.Scene,
                bpy.types.WindowManager,
                bpy.types.Mesh,
                bpy.types.Collection,
            )
            for name in dir(owner)
            if "headshop" in name.lower()
        ],
        "handlers": [
            (name, handler.__name__)
            for name in dir(handlers)
            if isinstance(getattr(handlers, name), list)
            for handler in getattr(handlers, name)
            if "headshop" in getattr(handler, "__module__", "")
        ],
        "operators": [name for name in dir(bpy.ops.headshop)],
    }


def test_enabling_and_disabling_twice_leaves_nothing(bpy, reference):
    import addon_utils

    before = _traces(bpy)
    assert not any(before.values())
    for _ in range(2):
        assert addon_utils.enable("headshop", default_set=True) is not None
        during = _traces(bpy)
        assert len(during["classes"]) > 30 and during["handlers"]
        assert during["properties"] == ["Object.headshop", "Scene.headshop"]
        addon_utils.disable("headshop", default_set=True)
        assert _traces(bpy) == before


def test_a_failure_while_enabling_is_raised_and_leaves_nothing(bpy, reference, monkeypatch):
    from headshop.headshop_addon import registration
    from headshop.panels import bake

    before = _traces(bpy)
    broken = type("HEADSHOP_PT_broken", (), {})  # no panel at all
    monkeypatch.setattr(bake, "classes", lambda: (bake.HEADSHOP_PT_bake, broken))
    with pytest.raises(RuntimeError, match="register_class"):
        registration.register()
    assert _traces(bpy) == before


def test_every_operator_file_holds_the_operator_it_is_named_after(addon):
    from headshop import operators

    files = {path.stem for path in (ROOT / "operators").glob("*.py")} - {"__init__"}
    assert files == set(operators.FILES)
    for name, cls in zip(operators.FILES, operators.classes(), strict=True):
        assert cls.__name__ == f"HEADSHOP_OT_{name}" and cls.bl_idname == f"headshop.{name}"
        assert "REGISTER" in cls.bl_options
        assert cls.__doc__ and not cls.__doc__.endswith("."), "the class docstring is the tooltip: no full stop"
        writes_only = name in ("save_landmarks", "export_head", "render_sheet")
        assert ("UNDO" in cls.bl_options) is not writes_only


def test_tooltips_are_not_broken_into_lines_as_the_code_is(addon):
    said = {name: getattr(addon.ops.headshop, name).get_rna_type().description for name in dir(addon.ops.headshop)}
    assert all(said.values()) and [name for name, text in said.items() if "\n" in text] == []


def test_every_button_is_grey_with_a_reason_in_an_empty_scene(addon):
    from headshop import operators

    for cls in operators.classes():
        call = getattr(addon.ops.headshop, cls.__name__.partition("_OT_")[2])
        if cls.__name__.partition("_OT_")[2] in ("import_scan", "make_sample"):
            assert call.poll()
        else:
            with pytest.raises(RuntimeError, match=r"poll\(\) (?!failed, context is incorrect)") as raised:
                call("EXEC_DEFAULT")
            assert re.search(r"[A-Z][a-z].* (first|head)", str(raised.value)), raised.value


def test_there_is_a_slider_for_every_muscle_and_control(addon, reference):
    from headshop.headshop_addon import muscle_names
    from headshop.sim.acting.pose import CONTROLS

    group = addon.data.objects.new("Anything", None).headshop
    assert list(group.muscles.values()) == [muscle.name for muscle in reference.muscles]
    assert tuple(group.controls.values()) == CONTROLS
    for name, (_, lowest, _) in muscle_names.CONTROLS.items():
        setattr(group.controls, name, -5.0)
        assert getattr(group.controls, name) == lowest
    first = reference.muscles[0].name
    setattr(group.muscles, first, 7.0)
    assert getattr(group.muscles, first) == 1.0
    assert group.muscles.bl_rna.properties[first].is_animatable


def test_every_muscle_has_a_region_and_sides_stand_beside_each_other(reference):
    from headshop.headshop_addon import muscle_names

    rows = muscle_names.by_region()
    assert "Other" not in rows
    names = [name for row in rows.values() for pair in row for name in pair]
    assert sorted(names) == sorted(muscle.name for muscle in reference.muscles)
    for row in rows.values():
        for names in row:
            assert len(names) == 1 or (names[0].endswith("_r") and names[1] == names[0][:-2] + "_l")
