# SPDX-License-Identifier: GPL-3.0-or-later
"""The scan's colours carried over to the skin: an image on the skin's UV map, its holes filled, its light evened.

Colour comes from the scan points nearest to each texel; where there are none near enough, it spreads over the surface
like a membrane that goes back to the tone of most of the skin. Broad changes of brightness are taken to be light, not
skin, and are partly taken out.
"""

import bpy
import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from ..sim.mesh import Mesh, ends_of, vertex_areas, vertex_normals
from ..sim.progress import Progress, Work
from ..sim.scan.colour_space import LUMINANCE, to_linear, to_srgb
from ..sim.scan.specks import specks
from ..sim.scan.texture import has_pictures, strewn, texel_size
from ..sim.scan.winding import faces_away
from .scan_texture import fill
from .skin_paint import adjacency, smoothed, spread

NEIGHBOURS = 4
BLOCK = 60_000  # texels painted between two steps of progress
#: mm beyond the scan's own spacing within which its colour counts fully, and beyond which it does not count
NEAR, FAR = 1.5, 4.0
SIZE, TEXEL = 768, 0.7  # pixels, and mm that one is large about: finer than most scans
#: Of a scan with pictures on it: pixels of the finest image, and mm between the points at which those are looked at, at least.
LARGE, FINE = 2048, 0.3
EVENING = 0.55  # how much of the broad shading is taken out


class ScanColour:
    """A scan's colours, to be asked for at points near its surface.

    scan : Mesh in mm, with colours, standing where the skin stands
    about (k, 3) mm : of a scan with pictures on it, only what is near these points is looked at (None: all of it)

    It has the ``scan``, where pictures on it show more than its vertices, as points between those; ``ends`` (m, 3) mm, where
    its surface ends; the ``size`` in pixels of an image that shows all of it; and of what is looked at the ``points`` (k, 3)
    mm, their linear ``colour`` (k, 3), and the ``trust`` (k,) 0..1, at first 1, that they show what is asked for, such as skin.
    """

    def __init__(self, scan: Mesh, about: np.ndarray | None = None):
        whole, normals = ~specks(scan), vertex_normals(scan.vertices, scan.triangles)
        self.ends = ends_of(scan.vertices, scan.triangles[whole[scan.triangles].all(axis=1)])
        self.size = SIZE
        chosen = _looked_at(scan, whole, about)
        if chosen.any():
            scan, normals, spacing = _between_vertices(scan, chosen)
            whole, self.size = slice(None), _size_for(spacing)
        self.points = points = scan.vertices[whole]
        self.scan = scan
        self.normals = normals[whole]
        self.colour = to_linear(np.asarray(scan.colour, dtype=float)[whole])
        self.trust = np.ones(len(points))
        self.tree = cKDTree(points)
        some = points[:: max(len(points) // 2000, 1)]
        self.spacing = float(np.median(self.tree.query(some, k=2)[0][:, 1]))

    def turned_to(self, skin: Mesh) -> "ScanColour":
        """Itself, its normals out if the scan is wound inside out beside the ``skin``: what faces away would not count."""
        facing = vertex_normals(skin.vertices, skin.triangles)
        if faces_away(self.points, self.normals, skin.vertices, facing, self.spacing + FAR):
            self.normals = -self.normals
        return self

    def at(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linear colours (k, 3) and confidences (k,) 0..1 at points (k, 3) mm of a surface with normals (k, 3)."""
        reach = self.spacing + FAR  # what is farther does not count, and takes long to find
        distance, index = self.tree.query(points, k=NEIGHBOURS, distance_upper_bound=reach, workers=-1)
        index = np.minimum(index, len(self.colour) - 1)  # where nothing is in reach, at an infinite distance
        # what faces another way is the other side of something thin, such as an ear
        facing = np.clip(np.einsum("knj,kj->kn", self.normals[index], normals) * 2 - 0.2, 0, 1)
        near_by = facing / (distance + 0.3 * self.spacing) ** 2
        weight = near_by * self.trust[index]
        total = weight.sum(axis=1, keepdims=True)
        colour = (self.colour[index] * weight[..., None]).sum(axis=1) / np.maximum(total, 1e-12)
        near = self.spacing + NEAR
        confidence = np.clip((near + FAR - NEAR - distance[:, 0]) / (FAR - NEAR), 0, 1) * facing.max(axis=1)
        trust = total[:, 0] / np.maximum(near_by.sum(axis=1), 1e-12)
        # a little confidence is enough to hold a membrane: what is probably something else gives it none
        return colour, confidence * np.clip(2 * trust - 1, 0, 1)


def _looked_at(scan: Mesh, whole: np.ndarray, about: np.ndarray | None) -> np.ndarray:
    """(t,) bool: the triangles of the ``whole`` (n,) bool scan on which its pictures are looked at, none if it has none."""
    if not has_pictures(scan):
        return np.zeros(len(scan.triangles), dtype=bool)
    chosen = whole[scan.triangles].all(axis=1)
    if about is not None:
        low, high = about.min(axis=0) - FAR, about.max(axis=0) + FAR
        chosen &= ((scan.vertices > low) & (scan.vertices < high)).all(axis=1)[scan.triangles].any(axis=1)
    return chosen


def _between_vertices(scan: Mesh, chosen: np.ndarray):
    """Points (k, 3) with colours all over the ``chosen`` (t,) bool triangles of a scan with pictures on it, as a `Mesh` without
    faces, its normals there (k, 3), and mm that the points are apart: as far as the pictures' texels, within reason."""
    spacing = float(np.clip(texel_size(scan, chosen), FINE, TEXEL))
    points, normals, colour = strewn(scan, spacing, chosen)
    return Mesh(points, np.zeros((0, 4), np.int32), colour=colour), normals, spacing


def _size_for(spacing: float) -> int:
    """Pixels of an image that shows what is ``spacing`` mm apart: `SIZE`, or a power of two up to `LARGE`."""
    wanted = SIZE * TEXEL / spacing
    return SIZE if wanted <= SIZE else min(2 ** int(np.ceil(np.log2(wanted))), LARGE)


def unseen_skin(skin: Mesh, inner: np.ndarray, *covered: np.ndarray | None) -> np.ndarray:
    """(n,) 0..1, skin whose colour no scan tells: what is ``inner`` (n,) 0..1, what is ``covered`` (n,) bool, by hair or
    clothing (None: nothing is), and what is next to that, for there the scan shows the hair."""
    for hidden in covered:
        if hidden is not None:
            beside = adjacency(skin) @ hidden.astype(float) > 0
            inner = np.where(hidden | beside, 1.0, inner)
    return inner


def vertex_colour(skin: Mesh, source: ScanColour, unseen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Linear colour (n, 3) of each skin vertex and the gain (n,) that evens the light; None if the scan is elsewhere.

    unseen : (n,) 0..1, what no scanner sees, see `unseen_skin`
    """
    colour, confidence = source.at(skin.vertices, vertex_normals(skin.vertices, skin.triangles))
    confidence = confidence * (1 - np.clip(unseen, 0, 1))
    if (confidence > 0.5).sum() < 0.05 * len(confidence):
        return None
    link = adjacency(skin)
    # islands of doubtful colour at the edge of holes count less
    confidence = confidence * np.clip(2 * smoothed(confidence, link, 3) - 0.5, 0, 1)
    colour = spread(colour, confidence, link, vertex_areas(skin.vertices, skin.triangles))
    bright = np.log(np.maximum(colour @ LUMINANCE, 0.004))
    broad = smoothed(bright, link, 60)
    centre = np.average(broad, weights=confidence + 1e-9)
    gain = np.exp(np.clip(-EVENING * (broad - centre), -0.6, 0.5))
    # keep the person's own tone, but no darker or brighter than skin can be
    tone = float(np.exp(centre))
    return colour, gain * np.clip(tone, 0.05, 0.42) / tone


def texels(skin: Mesh, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each covered texel of a size x size image shows: texel index (k,), corners (k, 3), weights (k, 3).

    Every triangle is strewn with points finer than the texels; one point is kept for each texel.
    """
    faces, uv = skin.faces, skin.uv
    quad = np.flatnonzero(faces[:, 3] >= 0)
    corners = np.concatenate([faces[:, :3], faces[quad][:, [0, 2, 3]]])
    place = np.concatenate([uv[:, :3], uv[quad][:, [0, 2, 3]]]).astype(float) * size
    edge = np.linalg.norm(place - np.roll(place, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(edge * 1.25, 1, 4 * size)
    parts = np.ceil(2 ** (np.ceil(4 * np.log2(parts)) / 4)).astype(int)  # few different ones: like goes with like
    found, owner, inside = [], [], []
    for n in np.unique(parts):
        i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
        keep = i + j <= n
        weights = np.column_stack([i, j, n - i - j])[keep] / n
        of = np.flatnonzero(parts == n)
        pixel = np.floor(np.einsum("pk,tkc->tpc", weights, place[of])).astype(int).clip(0, size - 1)
        found.append((pixel[..., 1] * size + pixel[..., 0]).ravel())
        owner.append(np.repeat(of, len(weights)))
        inside.append(np.tile(weights, (len(of), 1)))
    index, first = np.unique(np.concatenate(found), return_index=True)
    return index, corners[np.concatenate(owner)[first]], np.concatenate(inside)[first]


def colour_image(skin: Mesh, source: ScanColour, unseen: np.ndarray, name: str, size: int | None = None) -> Work:
    """Work painting the scan's colours on the skin's UV map: (packed image, linear colour (n, 3) per vertex) or None.

    None if the scan has no part near the skin, or the skin has no UV map.
    """
    yield Progress(0.0, "Painting the skin")
    found = vertex_colour(skin, source, unseen)
    if found is None or skin.uv is None:
        return None
    colour, gain = found
    size = size or source.size
    yield Progress(0.2, "Painting the skin")
    index, corners, weights = texels(skin, size)
    normals = vertex_normals(skin.vertices, skin.triangles)

    places, facing, hidden = skin.vertices, normals, np.clip(unseen, 0, 1)
    painted = np.empty((len(index), 3))
    for start in range(0, len(index), BLOCK):
        yield Progress(0.3 + 0.6 * start / len(index), "Painting the skin")
        part = slice(start, start + BLOCK)

        def across(values: np.ndarray, part=part) -> np.ndarray:
            return np.einsum("kc,kc...->k...", weights[part], values[corners[part]])

        fine, confidence = source.at(across(places), across(facing))
        confidence = (confidence * (1 - across(hidden)))[:, None]
        painted[part] = (confidence * fine + (1 - confidence) * across(colour)) * across(gain)[:, None]
    yield Progress(0.9, "Painting the skin")
    pixels = np.zeros((size * size, 3))
    pixels[index] = np.clip(painted, 0, 1)
    covered = np.zeros(size * size, dtype=bool)
    covered[index] = True
    _, nearest = distance_transform_edt(~covered.reshape(size, size), return_indices=True)
    pixels = pixels.reshape(size, size, 3)[nearest[0], nearest[1]]
    image = bpy.data.images.get(name)
    if image is not None and tuple(image.size) != (size, size):
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(name, size, size, alpha=False)
    fill(image, to_srgb(pixels))
    return image, colour * gain[:, None]
