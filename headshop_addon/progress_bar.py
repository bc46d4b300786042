# SPDX-License-Identifier: GPL-3.0-or-later
"""A progress bar on stderr when it is a terminal, nothing otherwise."""

import sys
from contextlib import contextmanager

from ..sim.progress import Progress

_WIDTH = 28


@contextmanager
def progress_bar(wanted: bool = True):
    """Yields a function that shows a `Progress`, or None where there is no terminal; clears the line in the end."""
    if not wanted or sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    stream = sys.stderr

    def show(step: Progress) -> None:
        fraction = min(max(step.fraction, 0.0), 1.0)
        bar = ("█" * round(_WIDTH * fraction)).ljust(_WIDTH, "·")
        stream.write(f"\r{bar} {fraction:4.0%}  {step.label[:60]}\x1b[K")
        stream.flush()

    try:
        yield show
    finally:
        stream.write("\r\x1b[K")
        stream.flush()
