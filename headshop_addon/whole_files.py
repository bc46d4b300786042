# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether Blender wrote all of a file: on a full disk it leaves half of one and says nothing."""

import os
from pathlib import Path

from ..sim.errors import InputError

#: What every PNG ends with.
_PNG_END = b"IEND\xaeB`\x82"


def require_whole(path: Path) -> None:
    """Raise `InputError` unless all of a PNG, MP4 or USDC file was written; others are not looked at."""
    whole = {".png": _png, ".mp4": _mp4, ".usdc": _usdc}.get(path.suffix.lower())
    if whole is not None and not (path.is_file() and whole(path)):
        raise InputError(f"{path.name} cannot be written whole: is the disk full?")


def _png(path: Path) -> bool:
    """Whether a file ends as a PNG does."""
    if path.stat().st_size < len(_PNG_END):
        return False
    with path.open("rb") as file:
        file.seek(-len(_PNG_END), os.SEEK_END)
        return file.read() == _PNG_END


def _mp4(path: Path) -> bool:
    """Whether a file consists of whole MPEG-4 boxes, with the table of frames among them."""
    kinds, at, end = set(), 0, path.stat().st_size
    with path.open("rb") as file:
        while at < end:
            file.seek(at)
            head = file.read(16)
            size = int.from_bytes(head[:4], "big")
            size = int.from_bytes(head[8:], "big") if size == 1 else size
            if size < 8:
                return False
            kinds.add(head[4:8])
            at += size
    return at == end and b"moov" in kinds


def _usdc(path: Path) -> bool:
    """Whether a file has its table of contents, which is written last."""
    with path.open("rb") as file:
        head = file.read(24)
    return head[:8] == b"PXR-USDC" and 0 < int.from_bytes(head[16:], "little") < path.stat().st_size
