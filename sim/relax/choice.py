# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a fitted face is to be relaxed, and what the head is then made of."""

from typing import TYPE_CHECKING

from ..anatomy.head import Head
from ..errors import InputError
from .relaxed import Relaxed, relaxed

if TYPE_CHECKING:
    from ..adapt.skin_fit import SkinFit

#: ``auto`` relaxes where the lips are parted.
CHOICES = ("auto", "always", "never")


def require_choice(choice: str) -> None:
    """Raise `InputError` for a choice that is none of `CHOICES`."""
    if choice not in CHOICES:
        raise InputError(f"To relax {choice!r} is unknown: choose {', '.join(CHOICES)}.")


def to_be_followed(fit: "SkinFit", choice: str) -> tuple[Head, Relaxed | None]:
    """The reference that a fitted skin was warped from, and the relaxed skin (None: it stays as scanned)."""
    parted = fit.reference is not fit.lips_closed
    if choice == "always" or (choice == "auto" and parted):
        return fit.lips_closed, relaxed(fit.lips_closed, fit.cage, fit.fitted.fitted, fit.unseen)
    return fit.reference, None
