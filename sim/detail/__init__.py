# SPDX-License-Identifier: GPL-3.0-or-later
"""Fine detail of a scan that the mesh cannot follow, as a displacement and a normal map in the head's UVs."""
