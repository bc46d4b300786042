# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside Blender's window: answers questions of the driver, which moves the mouse from outside.

A question is a Python expression in ``$HEADSHOP_GUI/question``; the answer is written as JSON to ``answer``.
"""

import json
import os
import sys
import traceback
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

FOLDER = Path(os.environ["HEADSHOP_GUI"])


def window():
    """The only window."""
    return bpy.data.window_managers[0].windows[0]


def area():
    """The 3D viewport."""
    return next(area for area in window().screen.areas if area.type == "VIEW_3D")


def region(kind="WINDOW"):
    """Its region of a kind."""
    return next(region for region in area().regions if region.type == kind)


def box(kind):
    """Left, top, width, height of a region on the screen."""
    r = region(kind)
    return [r.x, window().height - r.y - r.height, r.width, r.height]


def open_sidebar():
    """Show the sidebar; its tab is chosen by a click."""
    area().spaces.active.show_region_ui = True
    area().spaces.active.show_gizmo = False
    area().tag_redraw()


def tab():
    """The sidebar's tab."""
    return region("UI").active_panel_category


def on_screen(points):
    """Screen pixels of world points of the viewport."""
    r, view = region(), area().spaces.active.region_3d
    found = [location_3d_to_region_2d(r, view, Vector(p)) for p in points]
    return [[r.x + p.x, window().height - (r.y + p.y)] for p in found]


def landmarks(*states):
    """Landmark -> world position, for the scan in question."""
    scan = bpy.context.scene.headshop.scan
    return {
        item.name: list(scan.matrix_world @ Vector(item.co)) for item in scan.headshop.landmarks if item.state in states
    }


def skin():
    """The skin of the only head, or None."""
    return next((obj for obj in bpy.context.scene.objects if obj.get("headshop_part") == "skin"), None)


def moved(name="Live"):
    """How far the shape key moves any vertex, mm."""
    keys = skin().data.shape_keys
    if keys is None or name not in keys.key_blocks:
        return 0.0
    pairs = zip(keys.key_blocks[0].points, keys.key_blocks[name].points, strict=True)
    return max((a.co - b.co).length for a, b in pairs) * 1000


def counts():
    """How many datablocks of each kind there are."""
    kinds = ("objects", "meshes", "collections", "materials", "actions")
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def take_clipboard():
    """What was copied last; only once."""
    manager = bpy.data.window_managers[0]
    text = manager.clipboard
    if text:
        manager.clipboard = ""
    return text


def job():
    """Label of the job in progress, or an empty string."""
    from bl_ext.user_default.headshop.headshop_addon import jobs

    return f"{jobs.running.title}: {jobs.running.label}" if jobs.running else ""


def asked():
    """The landmark being asked for."""
    from bl_ext.user_default.headshop.headshop_addon import landmark_overlay

    return landmark_overlay.asked_for


def to_correct():
    """The landmark whose correction is said to help most."""
    from bl_ext.user_default.headshop.headshop_addon import scan_landmarks

    return next(iter(scan_landmarks.most_useful(bpy.context.scene.headshop.scan)), "")


def skin_look():
    """Names of the materials that the skin shows, and what solid viewports colour by."""
    shown = [slot.material.name for slot in skin().material_slots]
    return [*shown, area().spaces.active.shading.color_type]


def prepared():
    """Whether the head holds what was learnt of its simulation."""
    from bl_ext.user_default.headshop.headshop_addon import response

    return response.is_prepared(skin())


def settled():
    """Whether every face has come to rest where its sliders say."""
    from bl_ext.user_default.headshop.headshop_addon import following

    return all(each.settled for each in following.kept.values())


def _answer():
    question = FOLDER / "question"
    if question.exists():
        text = question.read_text()
        question.unlink()
        try:
            answer = {"value": eval(text, globals())}
        except Exception:
            answer = {"error": traceback.format_exc()}
        (FOLDER / "answer.part").write_text(json.dumps(answer, default=str))
        (FOLDER / "answer.part").rename(FOLDER / "answer")
    return 0.05


def _ready():
    area().tag_redraw()
    print("READY")
    sys.stdout.flush()


bpy.context.preferences.view.show_splash = False
bpy.context.preferences.view.show_developer_ui = False
bpy.app.timers.register(_answer, first_interval=0.5, persistent=True)
bpy.app.timers.register(_ready, first_interval=3.0)
