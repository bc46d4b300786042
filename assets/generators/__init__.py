# SPDX-License-Identifier: GPL-3.0-or-later
"""Generators of the shipped assets: run by the project, not by users."""
