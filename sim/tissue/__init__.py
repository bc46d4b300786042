# SPDX-License-Identifier: GPL-3.0-or-later
"""Layered tissue over bone, pulled by muscles (Lee, Terzopoulos and Waters 1995, section 3)."""
