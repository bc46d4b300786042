# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as somebody's JSON has them: text, true, NaN and whole ones of hundreds of digits among them."""

import math


def is_number(value) -> bool:
    """Whether ``value`` is a finite number that a float can hold."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False
