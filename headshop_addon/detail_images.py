# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's detail maps as images in the .blend, packed, and as files."""

import tempfile
from pathlib import Path

import bpy

from ..sim.anatomy.storage import write_atomically
from ..sim.detail.detail_map import DetailMaps
from ..sim.detail.files import displacement_png, normal_png
from ..sim.progress import Progress, Work, finish
from . import heads
from .detail_nodes import DetailImages, use_detail

#: Key of the skin object's ID property -> what its image is called, and its file in an export folder.
IMAGES = {
    "headshop_displacement": ("Displacement", "displacement.png"),
    "headshop_normal": ("Normal", "normal.png"),
}


def write_images(skin: bpy.types.Object, maps: DetailMaps) -> DetailImages:
    """Keep the maps with the head as packed 16-bit images, in place of earlier ones."""
    return finish(packing(skin, maps))


def packing(skin: bpy.types.Object, maps: DetailMaps) -> Work:
    """`write_images` as work with progress."""
    for number, (key, (title, _)) in enumerate(IMAGES.items()):
        yield Progress(number / len(IMAGES), "Packing the detail maps")
        data = (displacement_png, normal_png)[number](maps)
        image = _packed(f"{heads.head_name(skin)} {title}", data)
        old = skin.get(key)
        skin[key] = image
        if isinstance(old, bpy.types.Image):
            old.user_remap(image)
            bpy.data.images.remove(old)
    return images_of(skin)


def _packed(name: str, data: bytes) -> bpy.types.Image:
    with tempfile.TemporaryDirectory(prefix="headshop-") as folder:
        path = Path(folder) / "detail.png"  # not after the head, whose name may be too long for a file's
        write_atomically(path, data)
        image = bpy.data.images.load(str(path), check_existing=False)
        image.colorspace_settings.name = "Non-Color"
        image.pack()
        image.filepath_raw = f"//{name.replace('/', '_')}.png"  # where it would be unpacked to
    image.name = name
    return image


def images_of(skin: bpy.types.Object) -> DetailImages | None:
    """The head's detail images, if it has both."""
    found = [skin.get(key) for key in IMAGES]
    return DetailImages(*found) if all(isinstance(image, bpy.types.Image) for image in found) else None


def write_files(skin: bpy.types.Object, folder) -> None:
    """Write the head's packed detail images into a folder as they are. Raises `InputError` if they cannot be written."""
    for key, (_, name) in IMAGES.items():
        image = skin.get(key)
        if isinstance(image, bpy.types.Image) and image.packed_file is not None:
            write_atomically(Path(folder) / name, image.packed_file.data)


def show(skin: bpy.types.Object, mode: str) -> None:
    """Let the head's detail work as ``NONE``, ``NORMAL`` or ``DISPLACEMENT`` in its materials."""
    for material in skin.data.materials:
        if material is not None:
            use_detail(material, mode)
