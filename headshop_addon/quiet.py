# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's importers, exporters and file readers print from C; this keeps them off the terminal for a moment."""

import os
import sys
import tempfile
from contextlib import contextmanager


@contextmanager
def quiet():
    """Send what Blender prints (file descriptors 1 and 2) into a temporary file; yields a function that reads it.

    Without a terminal to print to, as in a windowed program, nothing is redirected.
    """
    try:
        saved = os.dup(1), os.dup(2)
    except OSError:
        yield lambda: ""
        return
    with tempfile.TemporaryFile() as kept:

        def text() -> str:
            kept.seek(0)
            return kept.read().decode(errors="replace")

        _flush()
        os.dup2(kept.fileno(), 1)
        os.dup2(kept.fileno(), 2)
        try:
            yield text
        finally:
            _flush()
            for number, descriptor in zip((1, 2), saved, strict=True):
                os.dup2(descriptor, number)
                os.close(descriptor)


def _flush():
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
