# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map of a fit as a picture: three views, the scale in millimetres, the sentence. Drawn without a renderer."""

import textwrap

import bpy
import numpy as np

from ..sim.adapt.fit_colour import INVENTED, LIMIT, fit_colours, scale_colours
from ..sim.errors import InputError
from ..sim.mesh import vertex_normals
from ..sim.mesh_subdivision import smoother
from ..sim.progress import Progress, Work
from ..sim.scan.viewpoint import Viewpoint, depth_map
from . import heads, heat_map
from .materials import head_axes
from .outputs import Outputs
from .pictures import write_picture
from .text_labels import put_text

PAGE, INK, DIM = (0.055, 0.058, 0.064), (0.95, 0.95, 0.94, 1.0), (0.95, 0.95, 0.94, 0.6)
VIEWS = (("Subject's right", -0.7), ("Front", 0.0), ("Subject's left", 0.7))  # radians toward the subject's left
WIDTH, HEIGHT, HEAD, FOOT = 560, 640, 110, 130  # pixels: a picture, the page's heading and its scale
MM = 0.5  # that a pixel covers


def render_fit(skin: bpy.types.Object, path, limit: float = LIMIT) -> Work:
    """Draw the heat map into a PNG file; returns its path.

    limit : mm at the ends of the scale

    Raises
    ------
    InputError : not a head, or one that was not fitted to a scan.
    """
    head = heads.read_head(skin)
    if not heat_map.has_fit(skin):
        raise InputError(f"{skin.name!r} was not fitted to a scan, or its attributes are gone: build the head again.")
    yield Progress(0.0, "Drawing the fit")
    axes, cage = head_axes(head), head.skin
    operator, quads = smoother(cage.faces, len(cage.vertices))
    vertices = operator @ (cage.vertices @ axes.T)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    colours = operator @ fit_colours(*heat_map.measured(skin), limit)
    at = head.landmark_positions()
    middle = axes @ (at["t_l"] + at["t_r"] + at["prn"] + at["v"] + at["gn"]) / 5
    page = np.empty((HEAD + HEIGHT + FOOT, len(VIEWS) * WIDTH, 4), dtype=np.float32)
    page[..., :3], page[..., 3] = PAGE, 1.0
    put_text(page, f"{heads.head_name(skin)}: distance from the scan", 36, 58, 34, INK)
    for number, (title, yaw) in enumerate(VIEWS):
        yield Progress((number + 0.5) / (len(VIEWS) + 1), f"Drawing the fit, {title.lower()}")
        left = number * WIDTH
        page[HEAD : HEAD + HEIGHT, left : left + WIDTH, :3] = drawn_view(vertices, triangles, colours, middle, yaw)
        put_text(page, title, left + WIDTH / 2, HEAD + HEIGHT - 8, 20, DIM, "centre")
    _scale(page, limit)
    sentence = heads.read_report(skin).get("fit", {}).get("sentence", "")
    for row, line in enumerate(textwrap.wrap(sentence, 150)[:2]):
        put_text(page, line, 36, HEAD - 22 + 24 * row, 19, DIM)
    with Outputs() as outputs:
        write_picture(outputs.file(path), page)
    return path


def drawn_view(vertices, triangles, colours, middle, yaw, width=WIDTH, height=HEIGHT, mm=MM) -> np.ndarray:
    """(height, width, 3) of the coloured surface, shaded a little, twice as fine and averaged.

    vertices (n, 3) mm along the head's axes, triangles (t, 3), colours (n, 3) sRGB; middle (3,) mm: what the picture is
    centred on; yaw rad toward the subject's left; mm that a pixel covers
    """
    view = Viewpoint.around(middle, yaw, 0.03, 1500.0, mm / 2, width * mm, height * mm)
    seen = depth_map(view, vertices, triangles)
    image = np.empty((view.height, view.width, 3), dtype=np.float32)
    image[:] = PAGE
    where = seen.triangle >= 0
    normal = seen.sample(vertex_normals(vertices, triangles), triangles, where)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    light = np.abs(normal @ view.axes[2])
    image[where] = seen.sample(colours, triangles, where) * (0.35 + 0.65 * light[:, None])
    return image.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))


def _scale(page, limit) -> None:
    """The colour scale with its numbers, and what grey means."""
    top, width, left = HEAD + HEIGHT + 34, 620, 36
    page[top : top + 26, left : left + width, :3] = scale_colours(np.linspace(-1, 1, width))[None]
    for place, text in ((0.0, f"{limit:.2f} mm inside"), (0.5, "on the scan"), (1.0, f"{limit:.2f} mm outside")):
        align = {0.0: "left", 0.5: "centre", 1.0: "right"}[place]
        put_text(page, text, left + place * width, top + 58, 20, INK, align)
    page[top : top + 26, left + width + 60 : left + width + 110, :3] = INVENTED
    put_text(page, "invented: no data there", left + width + 124, top + 20, 20, INK)
