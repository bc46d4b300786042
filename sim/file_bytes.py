# SPDX-License-Identifier: GPL-3.0-or-later
"""What is in a file, or one sentence why it cannot be read."""

from pathlib import Path

from .errors import InputError


def file_bytes(path) -> bytes:
    """All of a file.

    Raises
    ------
    InputError : it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}): check the name and that you may read it."
        ) from error
