# SPDX-License-Identifier: GPL-3.0-or-later
"""The relaxed face: a neutral head from a scan that smiles or opens its mouth (Lee, Terzopoulos and Waters 1995, 2.3)."""
