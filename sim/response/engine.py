# SPDX-License-Identifier: GPL-3.0-or-later
"""What a response was learnt from besides the head: the simulation itself, told apart by its program text and tables."""

import zlib
from functools import cache
from pathlib import Path

from .storage import FORMAT

_ROOT = Path(__file__).resolve().parents[2]
#: What decides where a pose of the tissue comes to rest; strengths are calibrated on it, the rest is the head's.
_PARTS = ("sim/tissue/*.py", "sim/acting/pose.py", "assets/tables/strengths.json")


@cache
def engine_mark(root: Path = _ROOT) -> int:
    """A number that changes with the simulation and with how a response is kept: one learnt otherwise is out of date."""
    mark = zlib.crc32(FORMAT.encode())
    for pattern in _PARTS:
        for file in sorted(root.glob(pattern)):
            mark = zlib.crc32(b"".join(file.read_bytes().split()), mark)
    return mark
