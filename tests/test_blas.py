# SPDX-License-Identifier: GPL-3.0-or-later
"""Work whose linear algebra is held to one thread."""

import sys

import pytest

from headshop.sim import blas
from headshop.sim.progress import Progress, finish


@pytest.fixture(autouse=True)
def fresh():
    """Libraries are looked for anew."""
    blas._libraries.cache_clear()
    yield
    blas._libraries.cache_clear()


def counts() -> set[int]:
    """How many threads the BLAS libraries of this process may use."""
    found = pytest.importorskip("threadpoolctl", reason="threadpoolctl is not installed").threadpool_info()
    return {library["num_threads"] for library in found if library["user_api"] == "blas"}


def test_one_thread_within_the_steps_and_as_before_between_them():
    threadpoolctl = pytest.importorskip("threadpoolctl", reason="threadpoolctl is not installed")

    within, between = [], []

    def work():
        for k in range(3):
            within.append(counts())
            yield Progress(k / 3, "Counting")
        within.append(counts())
        return "done"

    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        before = counts()
        assert finish(blas.on_one_thread(work()), lambda step: between.append(counts())) == "done"
        assert within == [{1}] * 4 and between == [before] * 3
        assert counts() == before


def test_threads_come_back_after_an_error_and_a_cancelled_work_is_closed():
    before, closed = counts(), []

    def work(fail):
        try:
            yield Progress(0.0, "Beginning")
            if fail:
                raise ValueError("broken")
            yield Progress(0.5, "Going on")
        finally:
            closed.append(fail)

    with pytest.raises(ValueError, match="broken"):
        finish(blas.on_one_thread(work(True)))
    started = blas.on_one_thread(work(False))
    next(started)
    started.close()
    assert closed == [True, False] and counts() == before


def test_without_threadpoolctl_work_runs_as_it_is(monkeypatch):
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)

    def work():
        yield Progress(0.5, "Half")
        return 7

    assert finish(blas.on_one_thread(work())) == 7


def test_a_skin_is_fitted_on_one_thread(monkeypatch):
    from headshop.sim.adapt import skin_fit

    seen = []

    def fitting(*_):
        seen.append(counts())
        yield Progress(0.5, "Half")

    monkeypatch.setattr(skin_fit, "_fitting", fitting)
    finish(skin_fit.fit_skin(None, None, {}))
    assert seen == [{1}]


def test_landmarks_are_found_on_one_thread(monkeypatch):
    from headshop.sim.landmarks import find, shape_space

    seen = []

    def finding(*_):
        seen.append(counts())
        yield Progress(0.5, "Half")

    monkeypatch.setattr(find, "_finding", finding)
    monkeypatch.setattr(shape_space, "_made", lambda head: seen.append(counts()))
    finish(find.find_landmarks(None))
    shape_space.shape_space.__wrapped__(None)
    assert seen == [{1}, {1}]
