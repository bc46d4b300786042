# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of a skin's vertices, whether the head has them or not."""

import numpy as np

from ..anatomy.head import Head


def group(head: Head, name: str) -> np.ndarray:
    """(n,) weights of a skin group; zeros where the head has none of that name."""
    found = head.groups.get(name)
    return np.zeros(len(head.skin.vertices)) if found is None else np.asarray(found, dtype=float)
