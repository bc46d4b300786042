# SPDX-License-Identifier: GPL-3.0-or-later
"""One thin operator per file: parse, call one function, report."""

from importlib import import_module

from ..headshop_addon.class_registry import register_all, unregister_all

FILES = (
    *("import_scan", "make_sample", "choose_scan"),
    *("find_landmarks", "load_landmarks", "save_landmarks", "click_landmarks", "clear_landmarks"),
    *("build_head", "dress_head", "repack_uv"),
    *("override_head", "reset_muscles", "set_expression", "key_sliders", "prepare_response"),
    *("bake_expressions", "bake_muscles", "bake_rig", "bake_performance", "remove_baked"),
    *("export_head", "render_sheet"),
)


def classes() -> list[type]:
    """The operator class of every file: ``HEADSHOP_OT_<file>``."""
    return [getattr(import_module(f".{name}", __package__), f"HEADSHOP_OT_{name}") for name in FILES]


def register():
    """Register all operators."""
    register_all(classes())


def unregister():
    """Unregister all operators."""
    unregister_all(classes())
