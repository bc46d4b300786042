# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets when the extension is enabled, and how all of it goes away again.

Every module of `MODULES` has ``register`` and ``unregister``; they run in this order, and backwards on the way out.
Nothing is swallowed: what cannot be registered stops the extension from being enabled, visibly, and whatever had been
registered before is taken back.
"""

import sys
from importlib import import_module

PACKAGE = __package__.rpartition(".")[0]
MODULES = (
    ".headshop_addon.preferences",
    ".headshop_addon.properties",
    ".headshop_addon.live",
    ".headshop_addon.landmark_overlay",
    ".operators",
    ".panels",
    ".headshop_addon.terminal",
)


def register():
    """Register everything; on failure nothing stays registered."""
    done = []
    try:
        for name in MODULES:
            module = import_module(name, PACKAGE)
            module.register()
            done.append(module)
    except BaseException:
        for module in reversed(done):
            module.unregister()
        raise


def unregister():
    """Take everything back, last first."""
    for name in reversed(MODULES):
        import_module(name, PACKAGE).unregister()
    if PACKAGE.startswith("bl_ext."):
        _forget_code()


def _forget_code():
    """Drop our modules, so that enabling again runs edited code.

    Only as an installed extension: a Python program that imported ``headshop`` keeps what it holds.
    """
    for name in [n for n in sys.modules if n == PACKAGE or n.startswith(PACKAGE + ".")]:
        del sys.modules[name]
