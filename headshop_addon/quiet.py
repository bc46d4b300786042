# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls into Blender that neither print nor break.

Importers, exporters and file readers print from C, and a Ctrl-C that strikes Python inside them can crash the process.
"""

import ctypes
import os
import signal
import sys
import tempfile
from contextlib import contextmanager, redirect_stderr, redirect_stdout

#: Ctrl-C, being told to end (as by ``timeout`` or a shutdown), and the terminal being closed, which Windows has not.
ENDINGS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def quiet():
    """Hold back what Blender prints, and Ctrl-C until the end; yields a function that reads what was printed.

    Where there is no terminal to print to, as in a windowed program, nothing is redirected.
    """
    with patient(), _redirected() as text:
        yield text


@contextmanager
def patient():
    """Ctrl-C and the like take effect at the end instead of in the middle."""
    struck, before = [], {}
    try:
        for number in ENDINGS:
            if callable(signal.getsignal(number)):  # a handler of Python's; Blender's own are left alone
                before[number] = signal.signal(number, lambda number, _: struck.append(number))
    except ValueError:  # not the main thread: no signals arrive here
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in struck[:1]:
            signal.raise_signal(number)


@contextmanager
def _redirected():
    """File descriptors 1 and 2, and Python's own streams, go into a temporary file."""
    try:
        saved = os.dup(1), os.dup(2)
    except OSError:
        yield lambda: ""
        return
    with tempfile.TemporaryFile() as kept:

        def text() -> str:
            _flush()
            kept.seek(0)
            return kept.read().decode(errors="replace")

        _flush()
        os.dup2(kept.fileno(), 1)
        os.dup2(kept.fileno(), 2)
        stream = os.fdopen(os.dup(kept.fileno()), "w", encoding="utf-8", errors="replace")
        try:
            with stream, redirect_stdout(stream), redirect_stderr(stream):  # whatever Python prints through
                yield text
        finally:
            _flush()
            for number, descriptor in zip((1, 2), saved, strict=True):
                os.dup2(descriptor, number)
                os.close(descriptor)


def _flush():
    """Empty the buffers of Python and of C, lest they be emptied onto the wrong descriptor."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    library = ctypes.cdll.ucrtbase if sys.platform == "win32" else ctypes.CDLL(None)
    library.fflush(None)
