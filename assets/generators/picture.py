# SPDX-License-Identifier: GPL-3.0-or-later
"""Quick shaded pictures of meshes without Blender: a z-buffer, three lights, occlusion in the depth map, wires."""

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter

from ...sim.mesh import vertex_normals
from ...sim.scan.viewpoint import Viewpoint, depth_map

PAGE = np.array([0.13, 0.135, 0.15])

#: Direction toward the light (right, down, forward of the camera: forward is negative here), colour, strength.
LIGHTS = (
    ((-0.55, -0.6, -0.7), (1.0, 0.96, 0.9), 0.8),
    ((0.8, -0.1, -0.5), (0.85, 0.92, 1.0), 0.28),
    ((0.3, -0.7, 0.75), (1.0, 1.0, 1.0), 0.35),
)


@dataclass(frozen=True, eq=False)
class Layer:
    """Something to draw: vertices (n, 3) mm, triangles (t, 3), colour (3,) or (n, 3), and lines.

    lines : (l, 2, 3) mm segments drawn on the surface, hidden where something lies in front
    ink : (3,) or (l, 3) colour of the lines
    gloss, polish : strength of the highlight, (n,) or one, and how narrow it is
    cover : share of what is behind that the layer hides; below 1 it is glass, drawn over all else
    ink_share : how much of what is under a line it covers, 0..1
    """

    vertices: np.ndarray
    triangles: np.ndarray
    colour: np.ndarray
    lines: np.ndarray | None = None
    ink: np.ndarray = field(default_factory=lambda: np.array([0.12, 0.08, 0.07]))
    gloss: np.ndarray | float = 0.12
    polish: float = 40.0
    cover: float = 1.0
    ink_share: float = 0.65


def draw(layers: list[Layer], view: Viewpoint) -> np.ndarray:
    """(h, w, 3) sRGB 0..1 of all layers seen together; anti-aliased by drawing at twice the size."""
    fine = Viewpoint(view.centre, view.axes, 2 * view.focal, 2 * view.width, 2 * view.height)
    image = np.empty((fine.height, fine.width, 3))
    image[:] = PAGE
    depth, where, diffuse, shine, _ = _lit([each for each in layers if each.cover == 1], fine)
    image[where] = _srgb(diffuse + shine)
    for each in layers:
        if each.lines is not None and len(each.lines):
            _ink(image, fine, depth, each)
    for each in layers:
        if each.cover < 1:
            near, where, diffuse, shine, facing = _lit([each], fine)
            front = near[where] < depth[where]
            where[where] = front
            behind = image[where] ** 2.2
            cover = each.cover + 0.4 * (1 - facing[front, None]) ** 4  # glass hides more at a slant
            image[where] = _srgb(behind + cover * (diffuse[front] - behind) + shine[front])
    return image.reshape(view.height, 2, view.width, 2, 3).mean(axis=(1, 3))


def _srgb(linear):
    return np.clip(linear, 0, 1) ** (1 / 2.2)


def _lit(layers: list[Layer], view: Viewpoint):
    """Depth map (h, w), where there is anything (h, w) bool, and there the diffuse light, the highlights (k, 3)
    and how squarely the surface is seen (k,) 0..1."""
    if not layers:
        none = np.zeros((0, 3))
        return (
            np.full((view.height, view.width), np.inf),
            np.zeros((view.height, view.width), dtype=bool),
            none,
            none,
            none[:, 0],
        )
    start = np.cumsum([0] + [len(each.vertices) for each in layers])
    vertices = np.concatenate([each.vertices for each in layers])
    triangles = np.concatenate([each.triangles + s for each, s in zip(layers, start[:-1], strict=True)])
    normals = np.concatenate([vertex_normals(each.vertices, each.triangles) for each in layers])
    colours = np.concatenate([np.broadcast_to(each.colour, each.vertices.shape) for each in layers])
    gloss, polish = (
        np.concatenate([np.broadcast_to(getattr(each, name), len(each.vertices)) for each in layers]).astype(float)
        for name in ("gloss", "polish")
    )
    seen = depth_map(view, vertices, triangles)
    where = seen.triangle >= 0
    n = seen.sample(normals, triangles, where) @ view.axes.T
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-9)
    away = n[:, 2] > 0.5
    n = np.where(away[:, None], -n, n)
    narrow = seen.sample(polish, triangles, where)[:, None]
    shade = np.full((len(n), 3), 0.24)
    shine = np.zeros((len(n), 3))
    for direction, tint, strength in LIGHTS:
        d = np.array(direction) / np.linalg.norm(direction)
        shade += strength * np.clip(n @ d, 0, None)[:, None] * tint
        half = d + [0, 0, -1]
        half /= np.linalg.norm(half)
        shine += strength * np.clip(n @ half, 0, None)[:, None] ** narrow * tint
    shade *= _open_sky(seen.depth)[where][:, None]
    lit = seen.sample(colours, triangles, where) ** 2.2 * shade * 1.25
    lit[away] *= [0.9, 0.45, 0.45]  # the inside of a surface shows red
    return seen.depth, where, lit, seen.sample(gloss, triangles, where)[:, None] * shine, np.clip(-n[:, 2], 0, 1)


def _open_sky(depth: np.ndarray) -> np.ndarray:
    """(h, w) 0.35..1: darker where the depth map lies behind its surroundings."""
    far = np.where(np.isfinite(depth), depth, np.nan)
    known = np.isfinite(depth)
    fill = np.where(known, far, 0.0)
    out = np.ones(depth.shape)
    for sigma, reach in ((4.0, 3.0), (14.0, 9.0)):
        mean = gaussian_filter(fill, sigma) / np.maximum(gaussian_filter(known.astype(float), sigma), 1e-6)
        behind = np.clip(np.where(known, far - mean, 0.0) - 0.1 * reach, 0, reach) / reach
        out *= 1 - 0.45 * behind
    return out


def _ink(image, view, depth, layer):
    """Draw a layer's segments into the picture, hidden by what is more than 0.6 mm nearer."""
    lines, ink = layer.lines, layer.ink
    ends = view.project(lines.reshape(-1, 3)).reshape(-1, 2, 3)
    count = np.ceil(np.abs(ends[:, 1, :2] - ends[:, 0, :2]).max(axis=1)).clip(1, 4000).astype(int) + 1
    of = np.repeat(np.arange(len(lines)), count)
    t = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count[of] - 1, 1)
    at = ends[of, 0] + t[:, None] * (ends[of, 1] - ends[of, 0])
    x, y = at[:, 0].astype(int), at[:, 1].astype(int)
    shown = (x >= 0) & (y >= 0) & (x < view.width) & (y < view.height)
    x, y, near, of = x[shown], y[shown], at[shown, 2], of[shown]
    on_top = near < depth[y, x] + 0.6
    x, y, of = x[on_top], y[on_top], of[on_top]
    colour = np.broadcast_to(ink, (len(lines), 3))[of]
    image[y, x] = (1 - layer.ink_share) * image[y, x] + layer.ink_share * colour


def montage(rows: list[list[np.ndarray]], gap: int = 4) -> np.ndarray:
    """(h, w, 3): pictures side by side in rows."""
    strips = []
    for row in rows:
        height = max(p.shape[0] for p in row)
        cells = [np.pad(p, ((0, height - p.shape[0]), (0, gap), (0, 0)), constant_values=0.08) for p in row]
        strips.append(np.concatenate(cells, axis=1))
    width = max(s.shape[1] for s in strips)
    return np.concatenate(
        [np.pad(s, ((0, gap), (0, width - s.shape[1]), (0, 0)), constant_values=0.08) for s in strips]
    )


def write_png(path, image: np.ndarray) -> None:
    """Write (h, w, 3) values 0..1 as an 8-bit PNG."""
    pixels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    height, width = pixels.shape[:2]
    raw = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    raw[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(raw.tobytes(), 6)) + chunk(b"IEND", b""))
