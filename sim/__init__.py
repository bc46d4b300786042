# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine: arrays in, arrays out (millimetres, seconds, grams, radians). Never imports bpy or mathutils."""
