# SPDX-License-Identifier: GPL-3.0-or-later
"""sRGB and linear light (IEC 61966-2-1)."""

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear light


def to_linear(srgb: np.ndarray) -> np.ndarray:
    """Linear light 0..1 of sRGB values 0..1."""
    srgb = np.asarray(srgb, dtype=float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0) + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB values 0..1 of linear light 0..1."""
    linear = np.asarray(linear, dtype=float)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)
