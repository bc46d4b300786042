# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin under the chin, from the jaw's lower edge to the front of the neck: it has no bone of its own to stand on.

As the mouth opens wide the chin comes back towards the neck, and what was between them has half its room. The floor of
the mouth goes down there with the hyoid bone, and skin, which is loose and wrinkles, goes down with it. Skin as firm as the
face's, between a jaw that turns and a neck that stays, would fold instead, in one place or in another.
"""

from dataclasses import dataclass

import numpy as np

from .geometry import smoothed

#: Share of the lower incisors' way down, as the jaw turns, by which the throat goes down besides what it turns with the jaw.
_SINK = 0.54
#: mm over which that fades out into chin and neck, and the share under which it is none.
_FADE, _LEAST = 12.0, 0.01
#: Stretching and bending of the sheet, a share of the face's.
_LOOSE = 0.08
#: Restoration to the posed rest, in multiples of that of skin over 8 mm of tissue: what lies under the skin fills the room.
_HOLD = 10.0
#: The group of the neck begins behind the jaw's edge and has come to this where skin is off the mandible for good.
_OFF = 0.125


@dataclass(frozen=True, eq=False)
class Throat:
    """All (n,). off: 0..1, how far skin has left the mandible for the neck; sink: share by which it goes down besides as
    the lower incisors do when the jaw turns; sheet: factor on stretching and bending; hold: restoration per mm² of skin, in
    multiples of that over 8 mm of tissue."""

    off: np.ndarray
    sink: np.ndarray
    sheet: np.ndarray
    hold: np.ndarray


def build_throat(jaw, neck, laplacian, area) -> Throat:
    """jaw, neck : (n,) the groups of the skin; laplacian (n, n), area (n,) as for `smoothed`."""
    off = np.clip(neck / _OFF, 0, 1)
    between = off * 4 * jaw * (1 - jaw)  # most where skin goes half with the jaw and half with the neck
    sink = np.maximum(_SINK * smoothed(between, laplacian, area, _FADE) - _LEAST, 0)
    return Throat(off, sink, _LOOSE**between, _HOLD * between)
