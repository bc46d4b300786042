# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures on a scan: read from the materials of its objects, and put on the object that it becomes."""

from dataclasses import replace
from pathlib import Path, PurePosixPath

import bpy
import numpy as np

from ..sim.mesh import Mesh
from ..sim.scan.colour_space import to_srgb
from ..sim.scan.texture import has_pictures
from .shader_nodes import Graph
from .shown_image import image_of

LARGEST = 4096  # pixels of a side: larger pictures are made smaller, for the skin's own is far smaller yet


def with_pictures(mesh: Mesh, obj: bpy.types.Object) -> Mesh:
    """``mesh``, which was read from ``obj``, with the pictures that its materials show; as it is, if they show none.

    ``obj`` may be evaluated, as modifiers may bring materials.
    """
    if mesh.uv is None or mesh.material is None:
        return mesh
    materials = [slot.material for slot in obj.material_slots]
    images = [None if material is None else image_of(material) for material in materials]
    read = {image: pixels_of(image) for image in dict.fromkeys(images) if image is not None}
    if all(pixels is None for pixels in read.values()):
        return mesh
    pictures = (read[i] if i is not None else _plain(m) for m, i in zip(materials, images, strict=True))
    return replace(mesh, pictures=tuple(pictures))


def pixels_of(image: bpy.types.Image) -> np.ndarray | None:
    """(h, w, 3) uint8 sRGB, first row at the bottom, no side longer than `LARGEST`; None: the picture's file is not there."""
    width, height = image.size
    if 0 in (width, height):
        return None
    scratch = None
    if max(width, height) > LARGEST:
        scratch = image = image.copy()
        share = LARGEST / max(width, height)
        image.scale(max(round(share * width), 1), max(round(share * height), 1))
        width, height = image.size
    try:
        flat = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(flat)
        pixels = flat.reshape(height, width, image.channels)
        pixels = pixels[:, :, :3] if image.channels >= 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
        if image.is_float:
            pixels = to_srgb(np.clip(pixels, 0, 1))
        return np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    finally:
        if scratch is not None:
            bpy.data.images.remove(scratch)


def picture_beside(path: Path, name: str) -> np.ndarray | None:
    """`pixels_of` the picture that the file at ``path`` calls ``name``, or of that of its name beside the file; None: there is
    none, or none that can be read."""
    relative = name.replace("\\", "/")  # written on Windows
    for place in (path.parent / relative, path.parent / PurePosixPath(relative).name):
        try:
            if not place.is_file():
                continue
            image = bpy.data.images.load(str(place.resolve()))
        except (OSError, RuntimeError):  # the first: of a name that is too long, or in a folder that is closed
            continue
        try:
            return pixels_of(image)
        finally:
            bpy.data.images.remove(image)
    return None


def _plain(material) -> np.ndarray | None:
    """A picture of one texel, of the colour that a material without a picture has."""
    if material is None:
        return None
    colour = np.array(material.diffuse_color[:3], dtype=float)
    return np.rint(255 * to_srgb(np.clip(colour, 0, 1))).astype(np.uint8).reshape(1, 1, 3)


def put_pictures(obj: bpy.types.Object, mesh: Mesh) -> None:
    """Give ``obj``, made of ``mesh``, a material for each of its pictures; those are packed into the file."""
    if not has_pictures(mesh):
        return
    for number, picture in enumerate(mesh.pictures):
        name = obj.name if len(mesh.pictures) == 1 else f"{obj.name} {number + 1}"
        obj.data.materials.append(_material(name, picture))


def _material(name, picture) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    graph = Graph(material)
    colour = (
        (0.8, 0.8, 0.8) if picture is None else graph.node("TexImage", image=_image(name, picture)).outputs["Color"]
    )
    surface = graph.node("BsdfPrincipled", {"Base Color": colour, "Roughness": 0.8})
    graph.node("OutputMaterial", {"Surface": surface.outputs[0]})
    return material


def _image(name, picture) -> bpy.types.Image:
    height, width = picture.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False)
    fill(image, picture / np.float32(255))
    return image


def fill(image: bpy.types.Image, colour: np.ndarray) -> None:
    """Give ``image`` the ``colour`` (h, w, 3) 0..1, sRGB, first row at the bottom, and pack it into the file."""
    rgba = np.ones((*colour.shape[:2], 4), dtype=np.float32)
    rgba[..., :3] = colour
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
