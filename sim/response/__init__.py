# SPDX-License-Identifier: GPL-3.0-or-later
"""How a head answers its sliders, sampled from the simulation: a thousand poses a second, and shape keys with drivers."""
