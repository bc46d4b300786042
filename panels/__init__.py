# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar layout, one file per step of the workflow."""
