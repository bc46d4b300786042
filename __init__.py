# SPDX-License-Identifier: GPL-3.0-or-later
"""Head Shop: a raw head scan goes in, a head that acts comes out.

The repository root is both this Python package (``headshop``) and the Blender extension. Nothing is imported until
Blender calls :func:`register`, so ``import headshop.sim`` works without Blender.
"""


def register():
    """Called by Blender when the extension is enabled."""
    from .headshop_addon import registration

    registration.register()


def unregister():
    """Called by Blender when the extension is disabled."""
    from .headshop_addon import registration

    registration.unregister()
