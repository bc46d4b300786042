# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks found on a scan in any place, turn and unit, without help."""
