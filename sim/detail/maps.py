# SPDX-License-Identifier: GPL-3.0-or-later
"""Displacement and normal map of a fitted head: what of the scan is finer than the mesh."""

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, zoom

from ..adapt.closest import Surface
from ..errors import InputError
from ..mesh import Mesh
from ..progress import Progress, Work, portion
from .chart import Chart, Texels, chart_of, texels
from .detail_map import DEEPEST, DetailMaps
from .height import heights

#: Texels along a side: half a millimetre each on a head.
SIZE = 1024
FADE = 8.0  # mm over which detail runs out beside places without data
_LARGEST = 8192  # texels along a side: more would not fit the memory of an ordinary machine
STEEPEST = 1.2  # the most it tilts: tangent of an angle


def require_size(size: int) -> None:
    """Raise `InputError` unless ``size`` is one of texels along a side, or 0 for no maps."""
    if not isinstance(size, (int, np.integer)) or not 0 <= size <= _LARGEST:
        raise InputError(
            f"Detail maps of {size!r} pixels cannot be made: give a whole number from 0 (none) to {_LARGEST}."
        )


def detail_maps(skin: Mesh, target: Surface, inner: np.ndarray, size: int = SIZE) -> Work:
    """Work returning the `DetailMaps` of a skin that was fitted to the scan ``target``.

    Parameters
    ----------
    skin : the cage (n vertices, mm) with UVs; the maps belong to the surface drawn of it
    inner : (n,) 0..1, what no scanner sees: mouth, nostrils, backs of lids
    size : texels along a side

    The height rides on the normal, so the maps stay in place however the head is deformed.
    """
    yield Progress(0.0, "Laying out the maps")
    chart = chart_of(skin)
    yield Progress(0.02, "Laying out the maps")
    trusted = np.clip(1 - 2 * (chart.cage @ np.asarray(inner, dtype=float)), 0, 1)
    coarse = _needed(size, _texel_mm(chart, size), target.edge_length)
    cover = texels(chart, np.ones(len(chart.triangles), dtype=bool), coarse)
    height, trust = yield from portion(heights(chart, cover, target, trusted), 0.05, 0.8)
    yield Progress(0.8, "Smoothing fine detail")
    scale = _texel_mm(chart, coarse)
    displacement = _settled(cover, height, trust, target.edge_length / scale, FADE / scale)
    displacement = padded(displacement, cover)
    if coarse != size:
        yield Progress(0.85, "Smoothing fine detail")
        displacement = zoom(displacement, size // coarse, order=3, mode="nearest", grid_mode=True)
        cover = texels(chart, np.ones(len(chart.triangles), dtype=bool), size)
    displacement = np.clip(displacement, -DEEPEST, DEEPEST)
    normal = yield from portion(_normals(chart, cover, displacement, trusted), 0.88, 0.96)
    yield Progress(0.96, "Padding the maps")
    raised = displacement.ravel()[cover.index]
    known = np.abs(raised) > 1e-3
    report = {
        "size": int(size),
        "share": float(known.mean()),
        "rms_mm": float(np.sqrt(np.mean(raised[known] ** 2))) if known.any() else 0.0,
        "max_mm": float(np.abs(raised).max(initial=0.0)),
    }
    return DetailMaps(displacement, padded(normal, cover), report)


def _needed(size: int, texel: float, edge: float) -> int:
    """Texels along a side that show all of a scan with edges of ``edge`` mm, ``texel`` mm at full ``size``: a half or
    a quarter of them do for a coarse one."""
    for part in (4, 2):
        if size % part == 0 and texel * part < 0.4 * edge:
            return size // part
    return size


def padded(values: np.ndarray, cover: Texels) -> np.ndarray:
    """A map (size, size, ...) whose bare texels take the value of the nearest covered one: no seam shows through."""
    bare = np.ones(cover.size**2, dtype=bool)
    bare[cover.index] = False
    nearest = distance_transform_edt(bare.reshape(cover.size, cover.size), return_distances=False, return_indices=True)
    return values[nearest[0], nearest[1]]


def _texel_mm(chart: Chart, size: int) -> float:
    """Median side of a texel on the skin, mm."""
    p, q = chart.vertices[chart.triangles], chart.uv[chart.triangles]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    e1, e2 = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    flat = np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
    return float(np.sqrt(np.median(area / np.maximum(flat, 1e-15)))) / size


def _settled(cover: Texels, height, trust, spacing: float, fade: float) -> np.ndarray:
    """(size, size) mm: measured heights without the scan's facets, holes closed from their rims, 0 far from data.

    spacing, fade : length of the scan's edges and of the run-out, in texels
    """
    size = cover.size
    weight, raised = np.zeros((size, size), dtype=np.float32), np.zeros((size, size), dtype=np.float32)
    weight.ravel()[cover.index], raised.ravel()[cover.index] = trust, trust * height
    near, far = max(0.45 * spacing, 0.5), fade / 2
    fine = _mean(raised, weight, near)
    sure = gaussian_filter(weight, near)
    broad, reach = _mean(raised, weight, far), gaussian_filter(weight, far)
    sure = np.clip(1.6 * sure - 0.3, 0, 1)
    run_out = np.clip(2.5 * reach, 0, 1) ** 2
    out = run_out * (sure * fine + (1 - sure) * broad)
    return np.clip(out, -DEEPEST, DEEPEST).astype(np.float32)


def _mean(raised, weight, sigma):
    """Mean of what is known around each texel (normalised convolution, Knutsson and Westin 1993)."""
    total = gaussian_filter(weight, sigma)
    return gaussian_filter(raised, sigma) / np.maximum(total, 1e-4)


def _normals(chart: Chart, cover: Texels, displacement, trusted) -> Work:
    """Work returning (size, size, 3) normals of the raised surface in the frame of tangent, bitangent, normal.

    The raised surface P + h N has, for heights small against the radius of curvature, the normal N - grad h.
    """
    size = cover.size
    valid = np.zeros(size * size, dtype=bool)
    valid[cover.index] = True
    slope_u, slope_v = (_slope(displacement, valid.reshape(size, size), axis) for axis in (1, 0))
    out = np.zeros((size * size, 3), dtype=np.float32)
    out[:, 2] = 1
    step = 100_000
    for start in range(0, len(cover.index), step):
        yield Progress(start / len(cover.index), "Turning detail into normals")
        some = cover.block(slice(start, start + step))
        normal, tangent, by_u, by_v = (
            some.across(chart, x) for x in (chart.normals, chart.tangents, chart.along_u, chart.along_v)
        )
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        tangent -= np.einsum("ij,ij->i", tangent, normal)[:, None] * normal
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
        e, f, g = (np.einsum("ij,ij->i", a, b) for a, b in ((by_u, by_u), (by_u, by_v), (by_v, by_v)))
        hu, hv = (s.ravel()[some.index] * size for s in (slope_u, slope_v))
        det = np.maximum(e * g - f * f, 1e-6 * e * g + 1e-12)
        gradient = ((g * hu - f * hv) / det)[:, None] * by_u + ((e * hv - f * hu) / det)[:, None] * by_v
        steep = np.linalg.norm(gradient, axis=1)
        gradient *= (some.across(chart, trusted) / np.maximum(1, steep / STEEPEST))[:, None]
        x = -np.einsum("ij,ij->i", gradient, tangent)
        y = -np.einsum("ij,ij->i", gradient, np.cross(normal, tangent))
        local = np.stack([x, y, np.ones_like(x)], axis=1)
        out[some.index] = local / np.linalg.norm(local, axis=1, keepdims=True)
    return out.reshape(size, size, 3)


def _slope(values, valid, axis):
    """Difference per texel along an axis: central inside, one-sided beside texels that are not ``valid``."""
    forward = np.zeros_like(values)
    there = np.zeros(values.shape, dtype=bool)
    ahead = [slice(None)] * 2
    here = [slice(None)] * 2
    ahead[axis], here[axis] = slice(1, None), slice(None, -1)
    ahead, here = tuple(ahead), tuple(here)
    forward[here] = values[ahead] - values[here]
    there[here] = valid[ahead] & valid[here]
    forward[~there] = 0
    backward, back_there = np.zeros_like(values), np.zeros(values.shape, dtype=bool)
    backward[ahead], back_there[ahead] = forward[here], there[here]
    count = there.astype(np.float32) + back_there
    return (forward + backward) / np.maximum(count, 1)
