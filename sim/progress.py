# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work is a generator of progress steps; its ``return`` value is the result.

A timer drives it in Blender's window, a plain loop everywhere else. Cancelling is closing the generator, so a stage
that made something half-way cleans up in ``finally``.
"""

from collections.abc import Callable, Generator
from typing import NamedTuple, TypeVar

Result = TypeVar("Result")


class Progress(NamedTuple):
    """How far the work is: ``fraction`` in 0..1 and a ``label`` of a few words for the artist."""

    fraction: float
    label: str


Work = Generator[Progress, None, Result]


def finish(work: Work, on_step: Callable[[Progress], None] | None = None):
    """Run ``work`` to its end and return its result, calling ``on_step`` with each step."""
    try:
        while True:
            try:
                step = next(work)
            except StopIteration as stop:
                return stop.value
            if on_step is not None:
                on_step(step)
    finally:
        work.close()


def portion(work: Work, start: float, stop: float) -> Work:
    """Re-yield ``work`` with its 0..1 squeezed into ``start``..``stop``; use with ``yield from``."""
    try:
        while True:
            try:
                step = next(work)
            except StopIteration as end:
                return end.value
            yield Progress(start + (stop - start) * step.fraction, step.label)
    finally:
        work.close()
