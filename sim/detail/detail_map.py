# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head's detail maps are."""

from dataclasses import dataclass

import numpy as np

DEEPEST = 2.0  # mm, the most a map displaces


@dataclass(frozen=True, eq=False)
class DetailMaps:
    """displacement (size, size) float32, mm along the normal, 0 where nothing is known; normal (size, size, 3) float32,
    unit vectors in tangent space (x along u, y along v, z outward: OpenGL's convention). Row 0 lies at v = 0.

    report : share of the skin with detail, and its root mean square and greatest height in mm
    """

    displacement: np.ndarray
    normal: np.ndarray
    report: dict
