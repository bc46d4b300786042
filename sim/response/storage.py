# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig as bytes, to be kept with its head: what the head itself knows (rest shape, jaw) is not said twice."""

import io
import json

import numpy as np

from ..anatomy.head import Head
from ..errors import InputError
from .jaw_frame import JawFrame
from .rig import Region, Rig
from .spending import Spending

FORMAT = "headshop-response/5"


def to_bytes(rig: Rig, accuracy: dict | None = None) -> bytes:
    """The rig as an ``.npz`` archive (same rig, same bytes); ``accuracy`` is what `accuracy.measured` found of it."""
    about = {"format": FORMAT, "muscles": rig.muscle_names, "sphincters": rig.sphincters, "accuracy": accuracy or {}}
    arrays = {"about": np.array(json.dumps(about)), "mutual": rig.spending.mutual, "beside": rig.spending.beside}
    arrays |= {"scale": rig.scale, "samples": rig.samples, "pulls": rig.pulls, "jaw": rig.frame.share}
    for number, region in enumerate(rig.regions):
        for field in ("vertices", "weights", "modes"):
            arrays[f"region.{number}.{field}"] = getattr(region, field)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def from_bytes(data: bytes, head: Head) -> tuple[Rig, dict]:
    """The rig of ``head`` that `to_bytes` wrote, and what was measured of it.

    Raises
    ------
    InputError : another version wrote it, it is damaged, or it belongs to a head with other vertices.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        about = json.loads(str(arrays["about"]))
    except Exception as error:  # a damaged archive fails in as many ways as there are bytes
        raise InputError("The response stored with this head cannot be read: prepare it again.") from error
    if about.get("format") != FORMAT:
        raise InputError(
            f"The response stored with this head is {about.get('format')!r}, not {FORMAT}: prepare it again."
        )
    regions = []
    while f"region.{len(regions)}.vertices" in arrays:
        fields = ("vertices", "weights", "modes")
        regions.append(Region(*(arrays[f"region.{len(regions)}.{field}"] for field in fields)))
    if max((int(region.vertices.max(initial=0)) for region in regions), default=0) >= len(head.skin.vertices):
        raise InputError("The response stored with this head is of a head with other vertices: prepare it again.")
    rig = Rig(
        tuple(about["muscles"]),
        Spending(arrays["mutual"], arrays["beside"]),
        JawFrame(head.skin.vertices, arrays["jaw"], head.jaw),
        tuple(about["sphincters"]),
        arrays["scale"],
        arrays["samples"],
        arrays["pulls"],
        tuple(regions),
    )
    return rig, about["accuracy"]
