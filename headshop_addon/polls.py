# SPDX-License-Identifier: GPL-3.0-or-later
"""Why a button is grey: polls of operators, with the reason for its tooltip."""

from . import active, dependencies

#: Why a head that was linked does not move, and what to do.
LINKED = "This head is linked from another file: press Override Head in the panel Muscles first"

#: Why landmarks cannot be placed on a scan that was linked: Blender saves none of them with this file.
SCAN_LINKED = "This scan is linked from another file: make it local first (Object, Relations, Make Local)"


def library(cls, name: str) -> bool:
    """A Python library is there."""
    if reason := dependencies.reason(name):
        cls.poll_message_set(reason)
        return False
    return True


def object_mode(cls, context) -> bool:
    """Nothing is being edited or sculpted, where meshes cannot be written."""
    if context.mode != "OBJECT":
        cls.poll_message_set("Leave edit, sculpt or paint mode first")
        return False
    return True


def scan(cls, context) -> bool:
    """There is a scan."""
    if active.scan(context) is None:
        cls.poll_message_set("Import a scan first")
        return False
    return True


def own_scan(cls, context) -> bool:
    """There is a scan, and this file keeps what is placed on it."""
    if not scan(cls, context):
        return False
    if active.is_foreign(active.scan(context)):
        cls.poll_message_set(SCAN_LINKED)
        return False
    return True


def own_head(cls, context) -> bool:
    """There is a head, and this file may change its sliders."""
    if not head(cls, context):
        return False
    if active.skin(context).library is not None:
        cls.poll_message_set(LINKED)
        return False
    return True


def head(cls, context) -> bool:
    """There is a head."""
    if active.skin(context) is None:
        cls.poll_message_set("Build a head first")
        return False
    return True
