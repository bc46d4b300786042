# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptation: landmarks, thin-plate splines and refinement (Kähler et al. 2002, sections 5 and 6)."""
