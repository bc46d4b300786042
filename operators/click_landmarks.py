# SPDX-License-Identifier: GPL-3.0-or-later
"""Place landmarks by clicking the scan in the viewport."""

import bpy

from ..headshop_addon import active, bridge, heads, jobs, landmark_overlay, picking, polls
from ..headshop_addon import scan_landmarks as landmarks
from ..headshop_addon.bridge import METRES
from ..sim.anatomy.landmark_names import label

_SKIP = {"RIGHTMOUSE", "N"}
_LEAVE_OUT = {"X", "DEL"}  # by which Blender deletes the selected objects
#: With Ctrl they show another workspace, while what the status bar says stays in this one, or save the file, and with it heads
#: hidden that make way for the scan.
_LEAVE = {"PAGE_UP", "PAGE_DOWN", "S"}
_END = {"ESC", "RET", "NUMPAD_ENTER"}


class HEADSHOP_OT_click_landmarks(bpy.types.Operator):
    """Click the landmarks on the scan, one after the other. After three, the rest follow and only need correcting"""

    bl_idname = "headshop.click_landmarks"
    bl_label = "Click Landmarks"
    bl_options = {"REGISTER", "UNDO"}

    start: bpy.props.StringProperty(name="Landmark", description="Ask for this landmark only", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, context, properties):
        """Another tooltip where one landmark is asked for."""
        if properties.start:
            return f"Click where this landmark lies: {label(properties.start)}. Found and estimated ones follow"
        return cls.__doc__

    @classmethod
    def poll(cls, context):
        """Needs a scan and the warp."""
        return polls.own_scan(cls, context) and polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def execute(self, context):
        """Clicking needs a window."""
        self.report({"ERROR"}, "Landmarks are clicked in a 3D viewport: use Load Landmarks without a window.")
        return {"CANCELLED"}

    def invoke(self, context, event):
        """Begin asking."""
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, "Landmarks are clicked in a 3D viewport: start from its sidebar.")
            return {"CANCELLED"}
        from ..sim.scan.specks import specks

        self._scan = active.scan(context)
        self._specks = specks(bridge.object_to_mesh(self._scan))
        self._steps = []
        self._skipped = []
        self._chosen = self.start or None
        self._before = landmarks.snapshot(self._scan)
        if landmarks.next_to_place(self._scan, (), self._chosen) is None:
            self.report({"INFO"}, "All landmarks are placed: choose one in the list to place it anew.")
            return {"CANCELLED"}
        context.scene.headshop.show_landmarks = True
        self._show_alone(context)
        if not self._can_go_on(context):
            self._finish(context)
            self.report({"ERROR"}, f"{self._scan.name} is in a collection that is hidden or excluded: show that first.")
            return {"CANCELLED"}
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        self._ask(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Click places, Ctrl-Z takes back, N or the right button skips, X leaves out, Esc or Enter ends; the view can turn."""
        if not self._can_go_on(context):
            self._finish(context)
            self.report({"WARNING"}, "Clicking landmarks has ended: the scan is gone, hidden, or being edited.")
            return {"FINISHED"}
        if event.type in _END and event.value == "PRESS":
            return self._end(context)
        if event.type in _LEAVE and (event.ctrl or event.oskey) and event.value == "PRESS":
            return self._end(context) | {"PASS_THROUGH"}
        if event.type == "Z" and (event.ctrl or event.oskey) and event.value == "PRESS":
            self._take_back(context)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value in {"PRESS", "DOUBLE_CLICK"}:
            region = picking.viewport_region(context.screen, event.mouse_x, event.mouse_y)
            if (
                region is None
            ):  # the artist has turned to a button: keep what there is and let the button have its click
                return self._end(context) | {"PASS_THROUGH"}
            return self._click(context, region, (event.mouse_x - region.x, event.mouse_y - region.y))
        if event.type in _SKIP and event.value == "PRESS":
            self._remember()
            self._skipped.append(self._name)
            self._chosen = None
            return self._end(context) if self.start else self._ask(context)
        if event.type in _LEAVE_OUT and event.value == "PRESS":
            self._remember()
            landmarks.leave_out(self._scan, self._name)
            self._skipped.append(self._name)
            self._chosen = None
            return self._end(context) if self.start else self._ask(context)
        if event.type in {"LEFTMOUSE", "RIGHTMOUSE", "Z", *_LEAVE_OUT}:
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}

    def cancel(self, context):
        """Blender closes the window."""
        self._finish(context)

    def _show_alone(self, context):
        """The scan is hidden once a head was built from it: it is shown, and such heads are not, until clicking ends."""
        scan = self._scan
        self._hidden = scan.hide_viewport
        scan.hide_viewport = False
        scan.hide_set(False)
        if context.space_data.local_view and scan.name in context.view_layer.objects:
            scan.local_view_set(context.space_data, True)
        parts = [obj for skin in heads.built_from(context.scene, scan) for obj in heads.stands_with(skin)]
        self._covered = [obj.name for obj in parts if not obj.hide_viewport]
        for name in self._covered:
            bpy.data.objects[name].hide_viewport = True

    def _can_go_on(self, context) -> bool:
        """Whether the scan can be seen, as an object."""
        return context.mode == "OBJECT" and self._is_there(context) and self._scan.visible_get()

    def _is_there(self, context) -> bool:
        try:
            return context.scene.objects.get(self._scan.name) == self._scan
        except ReferenceError:
            return False

    def _click(self, context, region, at):
        hit = picking.on_surface(context, region, at, self._scan, self._specks)
        if hit is None:
            self.report({"WARNING"}, "Click on the scan, or skip this landmark with N.")
            return {"RUNNING_MODAL"}
        self._remember()
        landmarks.put(self._scan, self._name, hit / METRES)
        landmarks.follow(self._scan)
        self._chosen = None
        return self._end(context) if self.start else self._ask(context)

    def _remember(self):
        self._steps.append((landmarks.snapshot(self._scan), list(self._skipped), self._chosen))

    def _take_back(self, context):
        if self._steps:
            taken, self._skipped, self._chosen = self._steps.pop()
            landmarks.restore(self._scan, taken)
            self._ask(context)

    def _ask(self, context):
        """Name the next landmark, or end when none is left."""
        self._name = landmarks.next_to_place(self._scan, self._skipped, self._chosen)
        if self._name is None:
            return self._end(context)
        landmark_overlay.asked_for = self._name
        count = len(landmarks.positions(self._scan))
        self._say_above(context, f"Click {self._name}: {label(self._name)}   ({count} placed)")
        keys = "N or right click: skip   |   X: leave out   |   Ctrl Z: take back   |   Esc or Enter: end and keep"
        context.workspace.status_text_set(f"Click {self._name}   |   {keys}")
        return {"RUNNING_MODAL"}

    def _say_above(self, context, text):
        """In the headers of all viewports: one may be maximised, split or closed while landmarks are clicked."""
        for area in jobs.viewports(context):
            area.header_text_set(text)
            area.tag_redraw()

    def _finish(self, context):
        for name in self._covered:
            if name in bpy.data.objects:
                bpy.data.objects[name].hide_viewport = False
        if self._covered and self._is_there(context):
            self._scan.hide_viewport = self._hidden
        landmark_overlay.asked_for = ""
        self._say_above(context, None)
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()

    def _end(self, context):
        self._finish(context)
        if landmarks.snapshot(self._scan) == self._before:
            return {"CANCELLED"}
        count = len(landmarks.positions(self._scan))
        self.report({"INFO"}, f"{count} landmark{'s' * (count != 1)} placed on {self._scan.name}")
        return {"FINISHED"}
