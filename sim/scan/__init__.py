# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans: what comes out of a scanner, and a virtual scanner."""
