# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m headshop``: the same program as ``headshop`` and ``blender --command headshop``."""

import sys

from .headshop_addon.command_line import main

if __name__ == "__main__":
    sys.exit(main())
