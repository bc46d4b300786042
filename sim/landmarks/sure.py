# SPDX-License-Identifier: GPL-3.0-or-later
"""How sure a found landmark must be to help to build a head."""

SURE = 0.25
