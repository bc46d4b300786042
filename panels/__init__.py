# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar layout only: one file per step of the workflow, all in the tab *Head Shop*."""

from importlib import import_module

from bpy.utils import register_class, unregister_class

FILES = ("scan", "landmarks", "build", "muscles", "expressions", "bake")

_registered: list[type] = []


def register():
    """Register the panels in the order of work."""
    for name in FILES:
        for cls in import_module(f".{name}", __package__).classes():
            register_class(cls)
            _registered.append(cls)


def unregister():
    """Unregister the panels, last first."""
    while _registered:
        unregister_class(_registered.pop())
