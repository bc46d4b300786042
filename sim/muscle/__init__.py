# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles that displace the skin directly (Waters 1986, 1987): no tissue, no bone needed, quick enough to play."""
