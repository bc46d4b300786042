# SPDX-License-Identifier: GPL-3.0-or-later
"""Anatomy: the parts of a head and what ties them together."""
