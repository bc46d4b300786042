# SPDX-License-Identifier: GPL-3.0-or-later
"""Cylindrical range maps: what a scanner records that turns about a head, and what it would record of any mesh."""

from dataclasses import dataclass, replace

import numpy as np

from ..angles import bearing
from ..mesh import Mesh
from .axis import upright_axis
from .rays import outermost

#: A map of a head and its neck is at most this high, mm; shoulders below are left out.
TALLEST = 340.0
TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class RangeMap:
    """Distance from a vertical axis, per longitude and height (Lee, Terzopoulos and Waters 1995, section 2).

    Seen from outside: the first row is at the top, and columns run from the subject's right over the face, at longitude
    0, to the left. A map may go all the way round (`closed`) or show a part.

    Attributes
    ----------
    radius : (h, w) float64, mm from the axis; NaN where not ``valid``
    valid : (h, w) bool, False in voids
    colour : (h, w, 3) float32 sRGB 0..1 or None; NaN where unknown
    first : rad, longitude of the first column; from the front toward the subject's left
    step : rad between columns, positive
    top : mm, height of the first row along the axis, from ``origin``
    rise : mm between rows, positive
    origin : (3,) mm, a point of the axis in the scan's place
    axes : (3, 3) rows: the subject's left, the back (longitude 0 looks the other way) and up along the axis
    """

    radius: np.ndarray
    valid: np.ndarray
    colour: np.ndarray | None
    first: float
    step: float
    top: float
    rise: float
    origin: np.ndarray
    axes: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.radius.shape

    @property
    def closed(self) -> bool:
        """Whether the last column borders on the first."""
        return abs(self.shape[1] * self.step - TURN) < 0.5 * self.step

    @property
    def longitudes(self) -> np.ndarray:
        """(w,) rad of the columns."""
        return self.first + self.step * np.arange(self.shape[1])

    @property
    def heights(self) -> np.ndarray:
        """(h,) mm of the rows, falling."""
        return self.top - self.rise * np.arange(self.shape[0])

    def points(self) -> np.ndarray:
        """(h, w, 3) mm: every texel's place; NaN in voids."""
        a = self.longitudes
        out = self.radius[..., None] * (np.sin(a)[:, None] * self.axes[0] - np.cos(a)[:, None] * self.axes[1])
        return self.origin + out + self.heights[:, None, None] * self.axes[2]

    def place(self, rows, columns, radius=None) -> np.ndarray:
        """(..., 3) mm at fractional rows and columns, at the map's own radius there or at ``radius`` mm."""
        rows, columns = np.asarray(rows, dtype=float), np.asarray(columns, dtype=float)
        radius = self.sample(rows, columns) if radius is None else np.asarray(radius, dtype=float)
        a, z = self.first + self.step * columns, self.top - self.rise * rows
        local = np.stack([radius * np.sin(a), -radius * np.cos(a), z + 0 * radius], axis=-1)
        return self.origin + local @ self.axes

    def texels(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Fractional row, fractional column and radius (mm) of ``points`` (..., 3) mm."""
        local = (np.asarray(points, dtype=float) - self.origin) @ self.axes.T
        longitude = bearing(local[..., 0], -local[..., 1])
        middle = self.first + self.step * (self.shape[1] - 1) / 2
        longitude = middle + np.mod(longitude - middle + np.pi, TURN) - np.pi
        rows = (self.top - local[..., 2]) / self.rise
        return rows, (longitude - self.first) / self.step, np.hypot(local[..., 0], local[..., 1])

    def sample(self, rows, columns, values: np.ndarray | None = None) -> np.ndarray:
        """Bilinear ``values`` (h, w) or (h, w, k), by default the radius, at fractional rows and columns.

        NaN outside the map and beside voids.
        """
        values = self.radius if values is None else values
        h, w = self.shape
        rows, columns = np.asarray(rows, dtype=float), np.asarray(columns, dtype=float)
        if self.closed:
            columns = np.mod(columns, w)
        inside = (rows >= 0) & (rows <= h - 1) & (columns >= 0) & (columns <= (w if self.closed else w - 1))
        r, c = np.where(inside, rows, 0), np.where(inside, columns, 0)
        i, j = np.minimum(r.astype(int), max(h - 2, 0)), np.minimum(c.astype(int), w - 1)
        below, beside = np.minimum(i + 1, h - 1), (j + 1) % w if self.closed else np.minimum(j + 1, w - 1)
        v, u = r - i, c - j
        out = 0.0
        for row, column, weight in (
            (i, j, (1 - v) * (1 - u)),
            (i, beside, (1 - v) * u),
            (below, j, v * (1 - u)),
            (below, beside, v * u),
        ):
            weight = weight.reshape(weight.shape + (1,) * (values.ndim - 2))
            out = out + np.where(weight > 0, weight * values[row, column], 0)
        return np.where(inside.reshape(inside.shape + (1,) * (values.ndim - 2)), out, np.nan)

    def moved(self, rotation: np.ndarray, shift=(0.0, 0.0, 0.0), scale: float = 1.0) -> "RangeMap":
        """The map of the same head turned by ``rotation`` (3, 3), scaled and shifted (mm)."""
        return replace(
            self,
            radius=self.radius * scale,
            top=self.top * scale,
            rise=self.rise * scale,
            origin=scale * rotation @ self.origin + np.asarray(shift, dtype=float),
            axes=self.axes @ rotation.T,
        )

    def fronted(self, column: float) -> "RangeMap":
        """The same map in the same place, ``column`` now at longitude 0; a closed map is rolled to have it midway."""
        w = self.shape[1]
        angle = self.first + self.step * column
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        out = replace(self, first=self.first - angle, axes=turn @ self.axes)
        if not self.closed:
            return out
        roll = int(round((w - 1) / 2 - column))
        first = out.first - roll * self.step
        colour = None if self.colour is None else np.roll(self.colour, roll, axis=1)
        return replace(
            out,
            radius=np.roll(self.radius, roll, axis=1),
            valid=np.roll(self.valid, roll, axis=1),
            colour=colour,
            first=first,
        )


def resample(
    mesh: Mesh,
    width: int = 512,
    height: int = 256,
    *,
    origin=None,
    axes=None,
    span: tuple[float, float] | None = None,
    grazing: float = 0.0,
) -> RangeMap:
    """The map of an upright ``mesh`` (mm, +Z up, face about toward -Y): the outermost surface along each ray.

    A ray leaves the axis at a right angle; where it meets the mesh is exact. Colours are those of the vertices.

    width, height : columns (all the way round) and rows
    origin (3,), axes (3, 3) : the axis, see `RangeMap`; by default vertical, behind the face and amid the head
    span : mm, lowest and highest height along the axis from ``origin``; by default the mesh's, `TALLEST` at most
    grazing : rad, the least angle between ray and surface that counts as seen; a laser sees little below 0.2
    """
    axes = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    origin = upright_axis(mesh.vertices @ axes.T) @ axes if origin is None else np.asarray(origin, dtype=float)
    local = (mesh.vertices - origin) @ axes.T
    triangles = mesh.triangles
    used = np.unique(triangles)
    if span is None:
        highest = local[used, 2].max()
        span = (max(local[used, 2].min(), highest - TALLEST), highest)
    rise = max(span[1] - span[0], 1e-6) / height
    top, step = span[1] - rise / 2, TURN / width
    first = -np.pi + step / 2
    radius, triangle, weights, slope = outermost(local, triangles, first, step, width, top, rise, height)
    valid = (triangle >= 0) & (slope >= np.sin(grazing))
    colour = None
    if mesh.colour is not None:
        colour = np.full((height, width, 3), np.nan, dtype=np.float32)
        corner = mesh.colour[triangles[triangle[valid]]]
        colour[valid] = np.einsum("ij,ijk->ik", weights[valid], corner)
    return RangeMap(np.where(valid, radius, np.nan), valid, colour, first, step, top, rise, origin, axes)


def reduced(range_map: RangeMap, by: tuple[int, int]) -> RangeMap:
    """The map with ``by`` = (rows, columns) texels made one, the mean of those valid."""
    h, w = (n // k for n, k in zip(range_map.shape, by, strict=True))

    def blocks(values):
        return values[: h * by[0], : w * by[1]].reshape(h, by[0], w, by[1], -1)

    valid = blocks(range_map.valid)
    share = valid.sum(axis=(1, 3))[..., 0]
    radius = np.where(valid, blocks(range_map.radius), 0).sum(axis=(1, 3))[..., 0]
    colour = None
    if range_map.colour is not None:
        values = blocks(range_map.colour)
        known = np.isfinite(values)
        count = known.sum(axis=(1, 3))
        colour = np.where(known, values, 0).sum(axis=(1, 3)) / np.where(count, count, np.nan)
        colour = colour.astype(np.float32)
    return replace(
        range_map,
        radius=np.where(share, radius / np.maximum(share, 1), np.nan),
        valid=share > 0,
        colour=colour,
        first=range_map.first + range_map.step * (by[1] - 1) / 2,
        step=range_map.step * by[1],
        top=range_map.top - range_map.rise * (by[0] - 1) / 2,
        rise=range_map.rise * by[0],
    )
