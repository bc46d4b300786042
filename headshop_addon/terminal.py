# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --command headshop``: the command line inside Blender."""

import bpy

_commands = []


def _run(arguments):
    from .command_line import main

    return main(arguments)


def register():
    """Offer the command."""
    _commands.append(bpy.utils.register_cli_command("headshop", _run))


def unregister():
    """Take the command back."""
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
