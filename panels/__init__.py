# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar layout only: one file per step of the workflow, all in the tab *Head Shop*."""

from importlib import import_module

from ..headshop_addon.class_registry import register_all, unregister_all

FILES = ("scan", "landmarks", "build", "muscles", "expressions", "bake")

_registered: list[type] = []


def register():
    """Register the panels in the order of work."""
    found = [cls for name in FILES for cls in import_module(f".{name}", __package__).classes()]
    register_all(found)
    _registered.extend(found)  # some are made anew at each call of classes()


def unregister():
    """Unregister the panels."""
    unregister_all(_registered)
    _registered.clear()
