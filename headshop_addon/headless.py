# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender without a window: started, a head opened, a picture made ready, the file saved, all without its chatter."""

from pathlib import Path

from ..sim.errors import InputError
from .quiet import quiet


def start_blender() -> None:
    """Make Blender's module ready with an empty scene.

    Raises
    ------
    InputError : it is not installed.
    """
    try:
        with quiet():
            import bpy
    except ModuleNotFoundError as error:
        raise InputError(
            "Blender's module is not installed here: run pip install bpy==5.0.1 (Python 3.11) or bpy==5.2.3 (Python "
            "3.13), or use blender --command headshop."
        ) from error
    with quiet():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def open_head(path, name: str | None = None):
    """Open a .blend without running its scripts; returns the skin of its only head, or of the one called ``name``.

    Raises
    ------
    InputError : it cannot be opened, or has no such head.
    """
    start_blender()
    import bpy

    from . import heads

    with quiet():
        try:
            bpy.ops.wm.open_mainfile(filepath=str(Path(path).resolve()), use_scripts=False)
        except RuntimeError as error:
            raise InputError(f"{path} is not a .blend file that can be opened: build the head again.") from error
    return heads.only_head(name=name)


def save(path: Path) -> None:
    """Write the scene as a compressed copy at ``path``.

    Raises
    ------
    InputError : it cannot be written.
    """
    import bpy

    with quiet():
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), check_existing=False, compress=True, copy=True)
        except RuntimeError as error:
            raise InputError(f"{path.name} cannot be written ({error}): is the disk full?") from error


def wake_cycles() -> None:
    """Let the renderer look for graphics cards now, while what it says about them is held back."""
    import bpy

    settings = getattr(bpy.context.scene, "cycles", None)
    with quiet():
        getattr(settings, "denoiser", None)


def set_up_view(skin) -> None:
    """Lights, a camera and a viewport on the head, so that the file opens as a picture."""
    import bpy

    from .opening_view import look_at
    from .stage import set_stage

    with quiet():
        set_stage(bpy.context.scene, skin)
    look_at(skin)
