# SPDX-License-Identifier: GPL-3.0-or-later
"""From the mouse to a point on a scan, which may have a hole right there."""

import math
from statistics import median

from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d


def viewport_region(screen, x: int, y: int):
    """The 3D region under a window position, of any viewport of ``screen``, or None: elsewhere, or over a header, sidebar or
    toolbar."""

    def holds(region):
        return region.x <= x < region.x + region.width and region.y <= y < region.y + region.height

    regions = [region for area in screen.areas if area.type == "VIEW_3D" for region in area.regions]
    inside = [region for region in regions if region.width > 1 and region.height > 1 and holds(region)]
    if any(region.type != "WINDOW" for region in inside):
        return None
    return inside[0] if inside else None


#: Pixels around the mouse that are looked at where the scan has a hole.
_RINGS = (5.0, 10.0, 18.0)


#: Specks in front of each other that a click passes through, and how far behind one it goes on, of the object's size.
_LAYERS, _BEHIND = 8, 1e-5


def on_surface(context, region, at, obj, specks=()):
    """The point of ``obj``'s surface under a position in a 3D region, in the object's own space; None where there is none.

    In a hole it is the point under the mouse at the depth of the hole's rim: a landmark may lie in mid-air.
    specks : (n,) bool, vertices (`sim.scan.specks`) that a click passes by
    """
    view = region.data  # in a quad view each region has a view of its own
    to_local = obj.matrix_world.inverted_safe()
    turn = to_local.to_3x3()
    graph = context.evaluated_depsgraph_get()

    def ray(dx, dy):
        where = (at[0] + dx, at[1] + dy)
        start = to_local @ region_2d_to_origin_3d(region, view, where)
        return start, (turn @ region_2d_to_vector_3d(region, view, where)).normalized()

    def hit(dx, dy):
        """Depth of what is hit and whether its outside is seen; (None, False) where nothing is."""
        start, along = ray(dx, dy)
        begin = start
        for _ in range(_LAYERS):
            found, point, normal, face = obj.ray_cast(begin, along, depsgraph=graph)
            if not found:
                break
            if not _is_speck(obj.data, face, specks):
                return (point - start).length, normal.dot(along) < 0
            begin = point + along * max(obj.dimensions) * _BEHIND
        return None, False

    start, along = ray(0, 0)
    depth, outside = hit(0, 0)
    turns = [k * math.tau / 8 for k in range(8)]
    for radius in () if outside else _RINGS:  # the inside of the far wall is seen through a hole only
        around = [hit(radius * math.cos(a), radius * math.sin(a)) for a in turns]
        rim = [d for d, seen in around if seen]
        if len(rim) >= 3:
            depth = median(rim)
            break
    return None if depth is None else start + along * depth


def _is_speck(data, face: int, specks) -> bool:
    """Whether a face that was hit belongs to a speck; faces that a modifier made never do."""
    if not len(specks) or face >= len(data.polygons):
        return False
    first = data.polygons[face].vertices[0]
    return first < len(specks) and bool(specks[first])
