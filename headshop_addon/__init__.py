# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on in Blender: registration, saved properties, the bridge between bpy and numpy, jobs, command line."""
