# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as somebody's JSON has them: text, true, NaN and whole ones of hundreds of digits among them."""

import math

from .errors import InputError


def is_number(value) -> bool:
    """Whether ``value`` is a finite number that a float can hold."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False


def require_tolerance(value) -> None:
    """Raise `InputError` unless ``value`` is a finite number above 0."""
    try:
        good = 0 < value < math.inf
    except (TypeError, ValueError):  # text, an array
        good = False
    if not good:
        raise InputError(f"The tolerance is {value!r}: give millimetres, a finite number above 0.")


def require_from_zero(what: str, constants: dict) -> None:
    """Raise `InputError` unless all ``constants``, name -> value, are finite numbers from 0 up; ``what`` has them."""
    for name, value in constants.items():
        try:
            good = math.isfinite(value) and value >= 0
        except (TypeError, ValueError, OverflowError):  # text, an array, a whole number beyond every float
            good = False
        if not good:
            raise InputError(f"{what} has {name} {value!r}: give a finite number from 0 up.")
