# SPDX-License-Identifier: GPL-3.0-or-later
"""Data we made and the generators that made it."""
