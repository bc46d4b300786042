# SPDX-License-Identifier: GPL-3.0-or-later
"""A virtual structured-light scanner: what such a device would deliver of a surface that we know exactly.

Each viewpoint is a camera and a projector some degrees apart. A point is measured where both see it and enough of the
pattern's light comes back; along the rays lie noise, the ripple of the fringes, quantisation and a rest of registration
error. Depth maps become sheets of triangles, torn where depth jumps; sheets overlap, specks float.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter

from ..mesh import Mesh, vertex_normals
from ..progress import Progress, Work
from .clean import components
from .colour_space import to_linear, to_srgb
from .sheets import joined, sheet, trimmed
from .viewpoint import Viewpoint, depth_map


@dataclass(frozen=True)
class VirtualScanner:
    """The device and how it is set up. Lengths in mm, angles in degrees.

    views : (yaw toward the subject's left, pitch up) of each camera
    target : where all of them look
    field : width and height of the image at the target
    pixel : size of a pixel at the target; 1 mm gives about 100,000 triangles of a face, ears and neck
    baseline : angle between camera and projector
    noise : standard deviation along the ray where the signal is full
    ripple, fringe : amplitude of the fringes' periodic error and the period of the pattern at the target
    quantum : step of depth
    registration : standard deviation of the views' shifts against each other (and of their turns over 100 mm)
    least_signal : part of the full signal below which nothing is measured
    steepest : greatest angle between ray and surface normal
    tear : jump of depth between neighbouring pixels that no triangle bridges, in pixels
    overlap : width of the strip in which two sheets lie one over the other; None keeps the whole sheets
    specks : how many floating specks a view has on average
    """

    views: tuple[tuple[float, float], ...] = ((0.0, 4.0), (50.0, 1.0), (-50.0, 1.0))
    target: tuple[float, float, float] = (0.0, -60.0, -20.0)
    distance: float = 650.0
    field: tuple[float, float] = (300.0, 360.0)
    pixel: float = 1.12
    baseline: float = 13.0
    noise: float = 0.07
    ripple: float = 0.035
    fringe: float = 4.2
    quantum: float = 0.04
    registration: float = 0.08
    least_signal: float = 0.10
    steepest: float = 77.0
    tear: float = 3.6
    overlap: float | None = 5.0
    specks: float = 4.0

    def scan(self, surface: Mesh, rng: np.random.Generator, response=None, gloss=None) -> Work:
        """The raw scan of ``surface`` (mm, +Z up, face toward -Y), a Mesh of triangles with colours.

        response : (n,) 0..1 or None, how much of the light each vertex returns beside its colour (hair, cloth: little)
        gloss : (n,) 0..1 or None, mirror-like part (wet eyes, oily skin): highlights blind the camera
        Same scanner, surface and state of ``rng``, same result.
        """
        n = len(surface.vertices)
        subject = _Subject(
            surface.vertices,
            surface.triangles,
            vertex_normals(surface.vertices, surface.triangles),
            np.full((n, 3), 0.5) if surface.colour is None else to_linear(surface.colour),
            np.ones(n) if response is None else np.asarray(response, dtype=float),
            np.zeros(n) if gloss is None else np.asarray(gloss, dtype=float),
        )
        captures = []
        for k, (yaw, pitch) in enumerate(self.views):
            yield Progress(k / (len(self.views) + 1), f"Scanning from view {k + 1}")
            captures.append(self._capture(subject, np.radians(yaw), np.radians(pitch), rng))
        yield Progress(len(self.views) / (len(self.views) + 1), "Joining the views")
        if self.overlap is not None:
            captures = trimmed(captures, self.overlap / self.pixel)
        mesh = joined([sheet(capture, self.tear * self.pixel) for capture in captures])
        return _without_crumbs(mesh)

    def _capture(self, subject, yaw, pitch, rng) -> "Capture":
        around = (self.distance, self.pixel, *self.field)
        camera = Viewpoint.around(self.target, yaw, pitch, *around)
        side = np.radians(self.baseline) * (1 if yaw <= 0 else -1)
        projector = Viewpoint.around(self.target, yaw + side, pitch, *around)
        seen = depth_map(camera, subject.vertices, subject.triangles)
        lit = depth_map(projector, subject.vertices, subject.triangles)
        where = seen.triangle >= 0
        pick = [seen.sample(v, subject.triangles, where) for v in subject.fields()]
        points, normals, albedo, response, gloss = pick
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        to_camera, to_projector = _toward(points, camera), _toward(points, projector)
        cos_c = np.einsum("ij,ij->i", normals, to_camera)
        cos_p = np.einsum("ij,ij->i", normals, to_projector)
        shape = where.shape
        coarse, fine = _field(rng, shape, 5.0)[where], _field(rng, shape, 1.2)[where]

        # the pattern's light that comes back; skin in front of both devices counts as full
        brightness = np.clip(albedo @ [0.25, 0.55, 0.2] / 0.35, 0, 1.3)
        signal = brightness * response * np.clip(cos_p, 0, 1) * np.clip(cos_c, 0, 1) ** 0.5
        measured = _lit(points, projector, lit, 1.2 * self.pixel)
        measured &= signal > self.least_signal * np.exp(0.25 * coarse + 0.35 * fine)
        limit = np.cos(np.radians(self.steepest + 1.5 * coarse))
        measured &= (cos_c > limit) & (cos_p > limit - 0.06)
        half = to_camera + to_projector
        mirror = np.einsum("ij,ij->i", normals, half / np.linalg.norm(half, axis=1, keepdims=True))
        glare = gloss * np.clip(mirror, 0, 1) ** 250
        measured &= glare < 0.55 * np.exp(0.3 * fine)

        # errors along the ray: they grow with distance and where little light returns
        depth = seen.depth[where]
        amplitude = self.noise * (depth / self.distance) ** 2 / np.clip(signal, 0.2, 1) ** 0.7
        amplitude *= 1 + 3 * np.clip(glare, 0, 1) + 4 * (1 - np.clip(response, 0, 1))
        white = rng.standard_normal(shape)
        noise = 0.55 * white[where] + 0.85 * _unit(gaussian_filter(white, 1.1))[where]
        column = projector.project(points)[:, 0] * self.pixel
        ripple = self.ripple * np.sin(2 * np.pi * column / self.fringe) * (1 + 0.5 * coarse)
        error = amplitude * noise + ripple
        step = self.quantum * (depth / self.distance) ** 2
        depth = np.round((depth + error) / step) * step

        shading = 0.62 + 0.38 * np.clip(cos_c, 0, 1)
        exposure = np.exp(0.03 * rng.standard_normal() + 0.012 * rng.standard_normal(3))
        colour = albedo * shading[:, None] * exposure
        colour = to_srgb(np.clip(colour + 0.35 * glare[:, None], 0, 1))
        colour = np.clip(colour + 0.008 * rng.standard_normal(colour.shape), 0, 1)

        depth_image = np.full(shape, np.inf)
        depth_image[where] = np.where(measured, depth, np.inf)
        colour_image = np.zeros((*shape, 3))
        colour_image[where] = colour
        quality = np.zeros(shape)
        quality[where] = np.where(measured, cos_c * np.clip(cos_p, 0, 1), 0)
        _mix_at_edges(depth_image, rng)
        self._add_specks(depth_image, colour_image, quality, rng)
        turn, shift = 0.01 * self.registration * rng.standard_normal(3), self.registration * rng.standard_normal(3)
        return Capture(camera, depth_image, colour_image, quality, turn, shift)

    def _add_specks(self, depth, colour, quality, rng) -> None:
        """Small patches floating near the edges: hair, reflections, what the pattern hit behind the subject."""
        valid = np.isfinite(depth)
        if not valid.any():
            return
        far, (row, column) = distance_transform_edt(~valid, return_indices=True)
        room = np.flatnonzero((far > 3) & (far < 45))
        if not len(room):
            return
        y, x = np.indices(depth.shape)
        for at in rng.choice(room, rng.poisson(self.specks)):
            cy, cx = divmod(int(at), depth.shape[1])
            radius = rng.uniform(1.0, 3.2, 2)
            patch = ((y - cy) / radius[0]) ** 2 + ((x - cx) / radius[1]) ** 2 < rng.uniform(0.5, 1.3, depth.shape)
            patch &= ~valid
            base = depth[row[cy, cx], column[cy, cx]] + 12 * rng.standard_normal() + 0.6 * far[cy, cx]
            depth[patch] = base + 0.5 * rng.standard_normal(patch.sum()) + 0.4 * (x - cx)[patch] * rng.standard_normal()
            colour[patch] = colour[row[cy, cx], column[cy, cx]] * rng.uniform(0.3, 0.9)
            quality[patch] = 1e-3


@dataclass(frozen=True, eq=False)
class Capture:
    """One view's measurement: depth (h, w) mm, inf for none; colour (h, w, 3) sRGB; quality (h, w) 0..1.

    turn (3,) rad, shift (3,) mm : the rest of registration error.
    """

    camera: Viewpoint
    depth: np.ndarray
    colour: np.ndarray
    quality: np.ndarray
    turn: np.ndarray
    shift: np.ndarray

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) of this view where its imperfect registration puts them."""
        return points + np.cross(self.turn, points - self.camera.centre - self.camera.axes[2] * 600) + self.shift


@dataclass(frozen=True, eq=False)
class _Subject:
    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    response: np.ndarray
    gloss: np.ndarray

    def fields(self):
        return self.vertices, self.normals, self.albedo, self.response, self.gloss


def _toward(points, view):
    ray = view.centre - points
    return ray / np.linalg.norm(ray, axis=1, keepdims=True)


def _lit(points, projector, lit, bias):
    """Whether the projector sees the points: its depth map, at the farthest of the four pixels around each."""
    x, y, depth = projector.project(points).T
    inside = (x > 0.5) & (y > 0.5) & (x < projector.width - 0.5) & (y < projector.height - 0.5)
    column, row = (
        np.clip(x - 0.5, 0, projector.width - 2).astype(int),
        np.clip(y - 0.5, 0, projector.height - 2).astype(int),
    )
    around = np.stack([lit.depth[row + i, column + j] for i in (0, 1) for j in (0, 1)])
    around[np.isinf(around)] = -np.inf  # beside the silhouette: no surface there
    return inside & (depth < around.max(axis=0) + bias)


def _unit(field):
    return field / field.std()


def _field(rng, shape, size):
    """Smooth noise (h, w) of unit deviation, blobs of ``size`` pixels."""
    return _unit(gaussian_filter(rng.standard_normal(shape), size))


def _mix_at_edges(depth, rng) -> None:
    """Pixels on an outline see two surfaces: some of them report a depth between, which leaves shreds and skirts."""
    valid = np.isfinite(depth)
    rim = valid & binary_dilation(~valid, iterations=1)
    bad = rim & (_field(rng, depth.shape, 0.8) > 0.6)
    depth[bad] += np.abs(_field(rng, depth.shape, 0.8)[bad]) * rng.gamma(1.0, 1.0, bad.sum())
    lost = rim & (_field(rng, depth.shape, 1.0) > 1.1)
    depth[lost] = np.inf


def _without_crumbs(mesh: Mesh, least: int = 3) -> Mesh:
    """Without pieces of fewer triangles than ``least``, which every scanner's software drops, and unused vertices."""
    triangles = mesh.triangles
    _, label = components(triangles, len(mesh.vertices))
    size = np.bincount(label[triangles[:, 0]], minlength=label.max() + 1)
    triangles = triangles[size[label[triangles[:, 0]]] >= least]
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[triangles.ravel()] = True
    return Mesh.from_triangles(mesh.vertices[used], (np.cumsum(used) - 1)[triangles], colour=mesh.colour[used])
