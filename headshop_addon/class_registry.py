# SPDX-License-Identifier: GPL-3.0-or-later
"""Register several Blender classes, all or none of them."""

from bpy.utils import register_class, unregister_class


def register_all(classes) -> None:
    """Register in order; where one cannot be registered, those before it are taken back and its error is raised."""
    done = []
    try:
        for cls in classes:
            register_class(cls)
            done.append(cls)
    except BaseException:
        unregister_all(done)
        raise


def unregister_all(classes) -> None:
    """Unregister, last first."""
    for cls in reversed(classes):
        unregister_class(cls)
