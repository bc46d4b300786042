# SPDX-License-Identifier: GPL-3.0-or-later
"""Performances: channels (muscles and controls) keyed over time, in a JSON file.

``{"format": "headshop-performance/1", "fps": 24, "channels": {"zygomaticus_major_l": [[0.0, 0.0], [0.8, 0.9]], ...}}``
with times in seconds and values as in `pose.Pose`. Between keys a channel eases: it leaves and arrives at rest at every
extreme and passes smoothly through keys on the way (monotone cubic, Fritsch and Carlson 1980), so nothing overshoots.

Channels of `outer.OUTER` are not of the face but of the room that it is in: ``head_x``, ``head_y``, ``head_z`` in mm along the
scan's axes and ``head_turn`` (to its left), ``head_nod`` (down), ``head_tilt`` (to its left shoulder) in rad move the
head; ``wind_x``, ``wind_y``, ``wind_z`` in mm/s say where the air goes, ``wind_turbulence`` 0..1 by what share of its speed it
fluctuates, differently for each ``"seed"``; ``gravity_x``, ``gravity_y``, ``gravity_z`` in mm/s² replace the earth's.
"""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..anatomy.storage import write_atomically
from ..errors import InputError
from ..finite_numbers import is_number
from ..json_keys import once
from .outer import OUTER
from .pose import Pose, pose_from

FORMAT = "headshop-performance/1"
_LONGEST = 36000.0  # seconds; a longer key time is a slip of the unit
_FARTHEST = 1e6  # mm, mm/s, mm/s² or rad of the channels of the room; more is a slip, and ends in numbers that are none
_SLOWEST, _FASTEST = 0.01, 1000.0  # frames a second that Blender's scenes can hold, and more than anybody needs


@dataclass(frozen=True)
class Performance:
    """fps frames a second; channels: name -> ((time s, value), ...) in order of time; name for the artist; seed of gusts."""

    channels: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    fps: float = 24.0
    name: str = "performance"
    seed: int = 0

    @property
    def duration(self) -> float:
        """Seconds from 0 to the last key."""
        return max((keys[-1][0] for keys in self.channels.values() if keys), default=0.0)

    @property
    def frame_count(self) -> int:
        """Frames from time 0 to the last key, both included."""
        return int(math.floor(self.duration * self.fps + 1e-6)) + 1

    def value(self, channel: str, time: float) -> float:
        """Eased value of a channel at ``time`` s."""
        return _eased(self.channels[channel], time)

    def pose(self, time: float) -> Pose:
        """The pose at ``time`` s."""
        face = {name: _eased(keys, time) for name, keys in self.channels.items() if keys and name not in OUTER}
        return pose_from(face)

    def frames(self) -> list[Pose]:
        """One pose per frame."""
        return [self.pose(k / self.fps) for k in range(self.frame_count)]


def _eased(keys, time: float) -> float:
    t = np.array([k[0] for k in keys])
    v = np.array([k[1] for k in keys])
    if time <= t[0]:
        return float(v[0])
    if time >= t[-1]:
        return float(v[-1])
    k = int(np.searchsorted(t, time, side="right")) - 1
    slope = _tangents(t, v)
    h = t[k + 1] - t[k]
    s = (time - t[k]) / h
    a, b = slope[k] * h, slope[k + 1] * h
    return float(
        v[k] * (2 * s**3 - 3 * s**2 + 1)
        + a * (s**3 - 2 * s**2 + s)
        + v[k + 1] * (3 * s**2 - 2 * s**3)
        + b * (s**3 - s**2)
    )


def _tangents(t, v):
    rise = np.diff(v) / np.diff(t)
    slope = np.zeros(len(t))
    if len(t) > 2:
        same = rise[:-1] * rise[1:] > 0
        mean = 2 * rise[:-1] * rise[1:] / np.where(same, rise[:-1] + rise[1:], 1.0)
        slope[1:-1] = np.where(same, mean, 0.0)
    return slope


def read_performance(path) -> Performance:
    """Read a performance file.

    Raises
    ------
    InputError : no such file, not JSON, another format, a channel whose keys are not [time, value] in order of time, one that
        is given twice, or one of the room that goes beyond all that heads meet.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=once)
    except FileNotFoundError:
        raise InputError(f"There is no performance file {path}: check the path.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): check the path and its permissions.") from None
    except KeyError as error:
        raise InputError(f"{path} gives {error.args[0]!r} twice: keep the right one.") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path} is not a JSON file: export the performance again.") from None
    return performance_from(document, str(path))


def performance_from(document, where: str = "The performance") -> Performance:
    """The performance in a parsed JSON ``document``; raises `InputError` as `read_performance`."""
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f'{where} is not a performance: it must say "format": "{FORMAT}".')
    fps = document.get("fps", 24)
    if not is_number(fps) or not _SLOWEST <= fps <= _FASTEST:
        raise InputError(
            f'{where}: "fps" must be a number of frames per second from {_SLOWEST:g} to {_FASTEST:g}, not {fps!r}.'
        )
    channels = document.get("channels")
    if not isinstance(channels, dict) or not channels:
        raise InputError(
            f'{where} has no "channels": add at least one, such as "zygomaticus_major_l": [[0, 0], [1, 1]].'
        )
    out = {}
    for name, keys in channels.items():
        good = isinstance(keys, list) and all(
            isinstance(k, list) and len(k) == 2 and all(map(is_number, k)) for k in keys
        )
        if not good or not keys:
            raise InputError(f"{where}: channel {name!r} must be a list of [time in seconds, value] pairs of numbers.")
        times = [k[0] for k in keys]
        if any(b <= a for a, b in zip(times, times[1:], strict=False)):
            raise InputError(
                f"{where}: the times of channel {name!r} must rise from key to key: sort them, drop doubles."
            )
        if times[0] < 0 or times[-1] > _LONGEST:
            raise InputError(f"{where}: the times of channel {name!r} must lie between 0 and {_LONGEST:g} seconds.")
        beyond = [v for _, v in keys if name in OUTER and abs(v) > _FARTHEST]
        if beyond:
            raise InputError(
                f"{where}: channel {name!r} goes to {beyond[0]:g}: keep it within {_FARTHEST:,.0f}, in mm, seconds and radians."
            )
        out[name] = tuple((float(t), float(v)) for t, v in keys)
    seed = document.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f'{where}: "seed" must be a whole number from 0 up, not {seed!r}.')
    return Performance(out, float(fps), str(document.get("name", "performance")), seed)


def write_performance(path, performance: Performance) -> None:
    """Write a performance file (under a temporary name first)."""
    document = {
        "format": FORMAT,
        "name": performance.name,
        "fps": performance.fps,
        "seed": performance.seed,
        "channels": {name: [list(k) for k in keys] for name, keys in performance.channels.items()},
    }
    write_atomically(path, (json.dumps(document, indent=1) + "\n").encode())


def sample_performance(name: str = "smile") -> Performance:
    """A performance of our own; only ``smile`` so far: anticipation, a Duchenne smile, a blink, and back.

    The left side starts a little earlier and goes a little farther, as in most people; cheeks lag behind the mouth.
    """
    if name != "smile":
        raise InputError(f"There is no sample performance {name!r}: use 'smile'.")
    channels: dict[str, tuple[tuple[float, float], ...]] = {}

    def both(base, keys, lag=0.04, share=0.9):
        channels[base + "_l"] = tuple(keys)
        channels[base + "_r"] = tuple((t + (lag if 0 < t < 2.9 else 0.0), v * share) for t, v in keys)

    both("depressor_anguli_oris", [(0.0, 0.0), (0.22, 0.12), (0.45, 0.0)])
    both("zygomaticus_major", [(0.0, 0.0), (0.25, 0.0), (0.85, 0.82), (1.55, 0.88), (2.0, 0.7), (2.9, 0.0)])
    both("zygomaticus_minor", [(0.0, 0.0), (0.3, 0.0), (0.9, 0.3), (1.8, 0.28), (2.7, 0.0)])
    both("levator_labii_superioris", [(0.0, 0.0), (0.4, 0.0), (0.95, 0.18), (1.7, 0.16), (2.5, 0.0)])
    both("risorius", [(0.0, 0.0), (0.35, 0.0), (0.9, 0.25), (1.7, 0.22), (2.6, 0.0)])
    both("orbicularis_oculi_orbital", [(0.0, 0.0), (0.4, 0.0), (1.0, 0.7), (1.6, 0.72), (2.1, 0.45), (2.8, 0.0)], 0.02)
    both("orbicularis_oculi_palpebral", [(0.0, 0.0), (0.4, 0.0), (1.0, 0.3), (1.7, 0.3), (2.6, 0.0)], 0.02)
    both("frontalis_outer", [(0.0, 0.0), (0.25, 0.18), (0.8, 0.05), (1.6, 0.08), (2.9, 0.0)], 0.0)
    channels["jaw_open"] = ((0.0, 0.0), (0.5, 0.0), (1.0, 0.07), (1.7, 0.06), (2.4, 0.0))
    blink = ((0.0, 0.0), (1.62, 0.0), (1.72, 1.0), (1.77, 1.0), (1.95, 0.0), (3.0, 0.0))
    channels["blink_l"] = channels["blink_r"] = blink
    channels["gaze_z"] = ((0.0, 0.0), (0.3, -0.12), (0.8, 0.0), (3.0, 0.0))
    return Performance(channels, 24.0, name)
