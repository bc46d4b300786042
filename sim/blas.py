# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear algebra held to one thread while many small systems are solved.

NumPy's and SciPy's BLAS share out even small products among all cores, and its threads keep waiting for more at full
speed, in the way of whatever else runs: on a busy machine a fit takes twice as long with them as without.
"""

from contextlib import nullcontext
from functools import cache

from .progress import Work


@cache
def _libraries():
    """The BLAS libraries of this process; None where threadpoolctl, which finds them, is not installed."""
    import scipy.linalg  # noqa: F401  it brings a BLAS of its own, which is to be found too

    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # only slower
        return None
    return ThreadpoolController()


def one_thread():
    """A context in which BLAS runs on one thread; without threadpoolctl nothing changes."""
    libraries = _libraries()
    return libraries.limit(limits=1, user_api="blas") if libraries else nullcontext()


def on_one_thread(work: Work) -> Work:
    """``work`` with `one_thread` round each of its steps: what runs in between keeps its threads."""
    try:
        while True:
            with one_thread():
                try:
                    step = next(work)
                except StopIteration as end:
                    return end.value
            yield step
    finally:
        work.close()
