# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that take a while: a generator of `Progress` driven by a timer in the window, by a loop everywhere else.

In the window the job shows its progress in the status bar and the sidebar, Esc cancels it, and everything else waits,
so nothing can pull the scene from under it. Either way Blender makes one undo step when it is finished and none when
it was cancelled: a job must leave nothing half-made when its generator is closed.
"""

import time
import traceback
from dataclasses import dataclass

import bpy

from ..sim.errors import InputError
from ..sim.progress import Progress, Work
from ..sim.progress import finish as run_to_the_end

_SLICE = 0.08  # seconds of work between two redraws
_NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION"}


@dataclass
class Running:
    """The job in progress, for the sidebar."""

    title: str
    panel: str = ""
    fraction: float = 0.0
    label: str = ""


#: The job in progress, if any; nothing but the sidebar's progress bar reads it.
running: Running | None = None


def sentence(error: Exception) -> str:
    """What to tell the artist about an error of the input or of the file system."""
    if isinstance(error, OSError):
        return f"{error.filename or 'The file'}: {error.strerror or error}."
    return str(error)


def _reported(operator, act) -> set[str]:
    """Do ``act()`` and report the sentence it returns, or the one about what is wrong with the input."""
    try:
        message = act()
    except (InputError, OSError) as error:
        operator.report({"ERROR"}, sentence(error))
        return {"CANCELLED"}
    if message:
        operator.report({"INFO"}, message)
    return {"FINISHED"}


class Simple:
    """Mixin of short operators: write ``act(context)``; input errors become reports."""

    def execute(self, context):
        """Run ``act``; report what is wrong with the input."""
        return _reported(self, lambda: self.act(context))


class Job:
    """Mixin of long operators: write ``work(context)``, a generator, and ``finish(context, result)``."""

    #: The panel that shows the progress.
    panel = ""
    _work: Work | None = None
    _timer = None

    def work(self, context) -> Work:
        """The generator to run."""
        raise NotImplementedError

    def finish(self, context, result) -> str | None:
        """Take the result into the scene; the returned sentence is reported."""

    def execute(self, context):
        """Run to the end at once, for scripts and Blender without a window."""
        return _reported(self, lambda: self.finish(context, run_to_the_end(self.work(context))))

    def invoke(self, context, event):
        """Run under a timer."""
        global running
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if running is not None:
            self.report({"WARNING"}, f"{running.title} is still running: wait, or press Esc to cancel it.")
            return {"CANCELLED"}
        self._work = self.work(context)
        running = Running(self.bl_label, self.panel)
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.modal_handler_add(self)
        self._show(context, Progress(0.0, "Starting"))
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Do a slice of work at each tick of the timer."""
        if event.type == "ESC" and event.value == "PRESS":
            self._end(context)
            self.report({"INFO"}, f"{self.bl_label}: cancelled, nothing was changed")
            return {"CANCELLED"}
        if event.type in _NAVIGATION:
            return {"PASS_THROUGH"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        try:
            try:
                self._advance(context)
                return {"RUNNING_MODAL"}
            except StopIteration as stop:
                return self._complete(context, stop.value)
        except ReferenceError:
            gone = "what it worked on was deleted or undone meanwhile, as another window lets one"
            return self._fail(context, f"{self.bl_label} has ended: {gone}.")
        except (InputError, OSError) as error:
            return self._fail(context, sentence(error))
        except Exception as error:  # the modal handler must go, whatever happened
            traceback.print_exc()
            return self._fail(
                context, f"{self.bl_label} failed ({type(error).__name__}: {error}). The console has more."
            )

    def cancel(self, context):
        """Blender closes the window."""
        self._end(context)

    def _advance(self, context):
        until = time.monotonic() + _SLICE
        step = next(self._work)
        while time.monotonic() < until:
            step = next(self._work)
        self._show(context, step)

    def _complete(self, context, result):
        self._end(context)
        return _reported(self, lambda: self.finish(context, result))

    def _fail(self, context, message):
        self._end(context)
        self.report({"ERROR"}, message)
        return {"CANCELLED"}

    def _show(self, context, step: Progress):
        running.fraction, running.label = min(max(step.fraction, 0.0), 1.0), step.label
        text = f"{self.bl_label}: {step.label}, {running.fraction:.0%}    |    Esc: cancel"
        for window in context.window_manager.windows:
            window.workspace.status_text_set(text)
        for area in viewports(context):
            for region in area.regions:
                if region.type == "UI":  # the sidebar alone: drawing a big scan anew at every step takes its time
                    region.tag_redraw()

    def _end(self, context):
        global running
        running = None
        if self._work is not None:
            self._work.close()
            self._work = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        for window in context.window_manager.windows:
            window.workspace.status_text_set(None)
        for area in viewports(context):
            area.tag_redraw()


class FileJob(Job):
    """Mixin of a job on a file that is chosen first; goes before ``ImportHelper`` among the bases.

    The file browser calls ``execute`` of an operator that it ends itself, so the job starts as a second call, with
    ``direct`` set. Scripts, and changes of its settings afterwards, run to the end at once.
    """

    direct: bpy.props.BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context, event):
        """Ask for the file, or run under a timer if it is known."""
        from bpy_extras.io_utils import ImportHelper

        return super().invoke(context, event) if self.direct else ImportHelper.invoke(self, context, event)

    def execute(self, context):
        """Start the job on the file that was chosen."""
        if bpy.app.background or context.window is None or self.direct or not self.options.is_invoke:
            return super().execute(context)
        module, _, name = type(self).bl_idname.partition(".")
        again = self.as_keywords(ignore=("filter_glob", "direct"))
        getattr(getattr(bpy.ops, module), name)("INVOKE_DEFAULT", direct=True, **again)
        return {"CANCELLED"}  # this call did nothing itself: no step to undo


def viewports(context):
    """Every 3D viewport of every window."""
    areas = (area for window in context.window_manager.windows for area in window.screen.areas)
    return [area for area in areas if area.type == "VIEW_3D"]
