# SPDX-License-Identifier: GPL-3.0-or-later
"""From the mouse to a point on a surface."""

from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d


def viewport_region(area, x: int, y: int):
    """The 3D region of ``area`` under a window position, or None: elsewhere, or over a header, sidebar or toolbar."""

    def holds(region):
        return region.x <= x < region.x + region.width and region.y <= y < region.y + region.height

    inside = [region for region in area.regions if region.width > 1 and region.height > 1 and holds(region)]
    if any(region.type != "WINDOW" for region in inside):
        return None
    return inside[0] if inside else None


def on_surface(context, area, region, at, obj):
    """The point of ``obj``'s surface under a region position, in the object's own space; None where there is none."""
    view = area.spaces.active.region_3d
    origin = region_2d_to_origin_3d(region, view, at)
    direction = region_2d_to_vector_3d(region, view, at)
    to_local = obj.matrix_world.inverted_safe()
    start = to_local @ origin
    along = (to_local.to_3x3() @ direction).normalized()
    hit, point, _normal, _face = obj.ray_cast(start, along, depsgraph=context.evaluated_depsgraph_get())
    return point if hit else None
