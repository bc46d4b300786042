# SPDX-License-Identifier: GPL-3.0-or-later
"""Long operators: the timer, Esc, errors. The window is a stand-in; the real one is tested by tests/gui."""

from types import SimpleNamespace

import pytest


class _Manager:
    """A window manager that notes timers and handlers."""

    def __init__(self):
        self.timers, self.handlers, self.status = [], [], []
        workspace = SimpleNamespace(status_text_set=self.status.append)
        self.windows = [SimpleNamespace(workspace=workspace, screen=SimpleNamespace(areas=[]))]

    def event_timer_add(self, _step, window):
        self.timers.append(object())
        return self.timers[-1]

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.handlers.append(operator)


@pytest.fixture
def window(blender, monkeypatch):
    """A context with a window, for jobs that believe in it."""
    from headshop.headshop_addon import jobs

    monkeypatch.setattr(jobs, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    manager = _Manager()
    yield SimpleNamespace(window=object(), window_manager=manager)
    assert jobs.running is None and not manager.timers
    assert manager.status == [] or manager.status[-1] is None


def _job(steps, ending=None):
    """A job that appends to ``made`` at its end and takes back what it began when closed."""
    from headshop.headshop_addon.jobs import Job
    from headshop.sim.progress import Progress

    class Count(Job):
        bl_label = "Count"

        def __init__(self):
            self.said, self.made, self.open = [], [], False

        def report(self, kind, text):
            self.said.append((kind, text))

        def work(self, context):
            self.open = True
            try:
                for k in range(steps):
                    yield Progress(k / steps, f"step {k}")
                if ending is not None:
                    raise ending
                return "done"
            finally:
                self.open = False

        def finish(self, context, result):
            self.made.append(result)
            return f"made {result}"

    return Count()


def _event(kind, value="NOTHING"):
    return SimpleNamespace(type=kind, value=value)


def _run(job, window):
    answer = job.invoke(window, None)
    while answer == {"RUNNING_MODAL"}:
        answer = job.modal(window, _event("TIMER"))
    return answer


def test_a_job_runs_to_its_end_under_the_timer(window):
    from headshop.headshop_addon import jobs

    job = _job(5)
    assert job.invoke(window, None) == {"RUNNING_MODAL"}
    assert jobs.running.title == "Count" and window.window_manager.timers
    assert _run_on(job, window) == {"FINISHED"}
    assert job.made == ["done"] and job.said == [({"INFO"}, "made done")]


def _run_on(job, window):
    answer = {"RUNNING_MODAL"}
    while answer == {"RUNNING_MODAL"}:
        answer = job.modal(window, _event("TIMER"))
    return answer


def test_escape_closes_the_work_and_makes_nothing(window):
    job = _job(10**9)
    job.invoke(window, None)
    assert job.modal(window, _event("TIMER")) == {"RUNNING_MODAL"} and job.open
    assert job.modal(window, _event("ESC", "PRESS")) == {"CANCELLED"}
    assert not job.open and not job.made
    assert "cancelled" in job.said[0][1]


def test_the_scene_cannot_be_touched_meanwhile_but_the_view_can_be_turned(window):
    job = _job(10**9)
    job.invoke(window, None)
    assert job.modal(window, _event("LEFTMOUSE", "PRESS")) == {"RUNNING_MODAL"}
    assert job.modal(window, _event("Z", "PRESS")) == {"RUNNING_MODAL"}
    assert job.modal(window, _event("MIDDLEMOUSE", "PRESS")) == {"PASS_THROUGH"}
    job.cancel(window)
    assert not job.open


def test_bad_input_is_reported_in_its_own_words(window):
    from headshop.sim.errors import InputError

    job = _job(2, InputError("The scan is empty: export it again."))
    assert _run(job, window) == {"CANCELLED"}
    assert job.said == [({"ERROR"}, "The scan is empty: export it again.")] and not job.made


def test_our_own_fault_ends_the_job_too(window, capsys):
    job = _job(2, ZeroDivisionError("division by zero"))
    assert _run(job, window) == {"CANCELLED"}
    assert "Count failed (ZeroDivisionError: division by zero)" in job.said[0][1]
    assert "Traceback" in capsys.readouterr().err, "the console has the traceback"


def test_what_was_deleted_meanwhile_is_said_to_be(window, capsys):
    job = _job(2, ReferenceError("StructRNA of type Object has been removed"))
    assert _run(job, window) == {"CANCELLED"}
    assert job.said[0][1].startswith("Count has ended: what it worked on was deleted") and not capsys.readouterr().err


@pytest.mark.parametrize("error", [ReferenceError, ZeroDivisionError])
def test_a_fault_at_the_end_ends_the_job_too(window, error):
    job = _job(2)

    def finish(_context, _result):
        raise error("at the end")

    job.finish = finish
    assert _run(job, window) == {"CANCELLED"} and job.said[0][0] == {"ERROR"}


def test_only_one_job_at_a_time(window):
    first, second = _job(10**9), _job(1)
    first.invoke(window, None)
    assert second.invoke(window, None) == {"CANCELLED"} and not second.made
    first.modal(window, _event("ESC", "PRESS"))


def test_without_a_window_a_job_is_a_plain_loop(blender):
    job = _job(3)
    assert job.invoke(SimpleNamespace(window=None), None) == {"FINISHED"}
    assert job.made == ["done"]
