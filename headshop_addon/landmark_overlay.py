# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks drawn over the viewport: a point each, names beside.

Blue where placed, green where found (dark where the scan shows nothing), small and yellow where estimated; a ring around
the one that is chosen or asked for, so that it hides nothing.

Drawing reads the saved landmarks of the scan and keeps nothing.
"""

import math

import blf
import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

from . import active, scan_landmarks
from .bridge import METRES
from .preferences import preferences

PLACED = (0.25, 0.85, 1.0, 1.0)
FOUND = (0.45, 1.0, 0.45, 1.0)
MID_AIR = (0.2, 0.45, 0.2, 1.0)
ESTIMATED = (1.0, 0.75, 0.25, 0.9)
CHOSEN = (1.0, 1.0, 1.0, 1.0)
SHADOW = (0.0, 0.0, 0.0, 0.8)

#: State -> colour and size, drawn in this order.
_DRAWN = {"DERIVED": (ESTIMATED, 0.6), "MID_AIR": (MID_AIR, 0.8), "FOUND": (FOUND, 0.8), "PLACED": (PLACED, 1.0)}

#: The landmark being asked for by the clicking operator, drawn larger; empty when nobody asks.
asked_for = ""
_handles: list = []


def points(context) -> list[tuple[str, str, Vector]]:
    """(name, state, world position) of the landmarks there are to draw; the state is MID_AIR for found ones there."""
    settings = context.scene.headshop
    scan = active.scan(context)
    if not settings.show_landmarks or scan is None or not scan.visible_get():
        return []
    matrix, mid_air = scan.matrix_world, scan_landmarks.in_mid_air(scan)
    places = scan_landmarks.positions(scan, "DERIVED", "PLACED", "FOUND")
    return [
        (i.name, "MID_AIR" if i.name in mid_air else i.state, matrix @ Vector(places[i.name] * METRES))
        for i in scan.headshop.landmarks
        if i.name in places
    ]


def _draw():
    import gpu
    from gpu_extras.batch import batch_for_shader

    context = bpy.context
    region, view = context.region, context.region_data
    on_screen = [(n, s, location_3d_to_region_2d(region, view, p)) for n, s, p in points(context)]
    on_screen = [(name, state, at) for name, state, at in on_screen if at is not None]
    if not on_screen:
        return
    settings, chosen = preferences(context), _chosen(context)
    scale = context.preferences.system.ui_scale
    size = (settings.point_size if settings else 9.0) * scale
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    for state, (colour, factor) in _DRAWN.items():
        at = [p for n, s, p in on_screen if s == state and n != chosen]
        _discs(shader, batch_for_shader, at, size * factor / 2, colour)
    _rings(shader, batch_for_shader, [p for n, _, p in on_screen if n == chosen], size, CHOSEN)
    gpu.state.blend_set("NONE")
    if context.scene.headshop.show_names:
        blf.size(0, (settings.text_size if settings else 12) * scale)
        for name, state, at in on_screen:
            if state == "PLACED" or name == chosen:
                _text(name, at.x + size * 0.7, at.y - size * 0.3, CHOSEN if name == chosen else PLACED)


def _chosen(context) -> str:
    if asked_for:
        return asked_for
    group = active.scan(context).headshop
    return group.landmarks[group.landmark_index].name if 0 <= group.landmark_index < len(group.landmarks) else ""


def _circle() -> list[tuple[float, float]]:
    """Twelve sides are round enough at this size."""
    return [(math.cos(k * math.tau / 12), math.sin(k * math.tau / 12)) for k in range(13)]


def _rings(shader, batch_for_shader, centres, radius, colour):
    """Rings with a dark rim and a point in the middle."""
    circle = _circle()
    for outer, inner, tint in ((radius + 1.5, radius * 0.7 - 1.5, SHADOW), (radius, radius * 0.7, colour)):
        strip = [(c.x + r * x, c.y + r * y) for c in centres for x, y in circle for r in (outer, inner)]
        if strip:
            shader.uniform_float("color", tint)
            batch_for_shader(shader, "TRI_STRIP", {"pos": strip}).draw(shader)
    _discs(shader, batch_for_shader, centres, radius * 0.15, colour)


def _discs(shader, batch_for_shader, centres, radius, colour):
    """Filled discs with a dark rim."""
    circle = _circle()
    for grow, tint in ((1.5, SHADOW), (0.0, colour)):
        triangles = []
        for centre in centres:
            rim = [(centre.x + (radius + grow) * x, centre.y + (radius + grow) * y) for x, y in circle]
            for first, second in zip(rim, rim[1:], strict=False):
                triangles += [(centre.x, centre.y), first, second]
        if triangles:
            shader.uniform_float("color", tint)
            batch_for_shader(shader, "TRIS", {"pos": triangles}).draw(shader)


def _text(text, x, y, colour):
    for dx, dy, tint in ((1, -1, SHADOW), (0, 0, colour)):
        blf.color(0, *tint)
        blf.position(0, x + dx, y + dy, 0)
        blf.draw(0, text)


def register():
    """Start drawing."""
    _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister():
    """Stop drawing."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
