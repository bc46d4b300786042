# SPDX-License-Identifier: GPL-3.0-or-later
"""Points without faces, as depth cameras, photogrammetry and surveys give them: the surface that they were measured on."""
