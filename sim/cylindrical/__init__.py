# SPDX-License-Identifier: GPL-3.0-or-later
"""Cylindrical range maps and the adaptation to them (Lee, Terzopoulos and Waters 1995, sections 2.1 and 2.2)."""
