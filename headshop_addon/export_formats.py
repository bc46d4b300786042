# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's exporters are asked for, one function a kind of file."""

from pathlib import Path

import bpy
import numpy as np

from ..sim.errors import InputError
from .engine_files import KINDS, textures_folder
from .shader_nodes import socket


def write_scene(path: Path, copies, animated: bool) -> None:
    """Write the context's scene, which holds the objects ``copies`` alone, in the form that the file's name asks for.

    What the copies wear may be changed (`plain_materials`).

    Raises
    ------
    InputError : the exporter is an add-on that is switched off.
    """
    kind, made = path.suffix.lower(), []
    try:
        if kind in (".usdc", ".usdz"):
            worn = dict.fromkeys(slot for obj in copies for slot in obj.data.materials if slot is not None)
            made += _paint_opacity(worn)
            # USD's exporter leaves out pictures that only the .blend holds
            made += _unpack(path.parent / (textures_folder(path) or "textures"), worn)
        _WRITERS[kind](str(path), animated)
    finally:
        bpy.data.batch_remove(made)


def _glb(path: str, animated: bool) -> None:
    if not hasattr(bpy.types, "EXPORT_SCENE_OT_gltf"):
        raise InputError("Blender's glTF add-on is off: switch it on in Preferences, Add-ons.")
    bpy.ops.export_scene.gltf(
        filepath=path,
        export_format="GLB",
        use_active_scene=True,
        export_apply=False,
        export_active_vertex_color_when_no_material=False,
        export_morph=True,
        export_morph_normal=True,
        export_animations=animated,
        export_animation_mode="SCENE",
        export_anim_scene_split_object=False,  # one clip: an engine that plays the skin's alone leaves eyes and teeth behind
        export_cameras=False,
        export_lights=False,
    )


def _fbx(path: str, animated: bool) -> None:
    bpy.ops.export_scene.fbx(
        filepath=path,
        object_types={"MESH"},
        use_mesh_modifiers=False,
        mesh_smooth_type="OFF",
        path_mode="COPY",
        embed_textures=True,
        bake_anim=animated,
        bake_anim_use_all_actions=False,
        bake_anim_use_nla_strips=False,
        bake_anim_simplify_factor=0.0,
    )


def _usd(path: str, animated: bool) -> None:
    bpy.ops.wm.usd_export(
        filepath=path,
        export_animation=animated,
        export_shapekeys=True,
        export_armatures=False,
        export_lights=False,
        export_cameras=False,
        # a packed file takes the pictures in; those of the other lie where they belong already
        export_textures_mode="KEEP" if path.lower().endswith(".usdc") else "NEW",
        relative_paths=True,
        convert_world_material=False,
        export_custom_properties=False,
    )


_WRITERS = dict(zip(KINDS, (_glb, _fbx, _usd, _usd), strict=True))


def _paint_opacity(materials) -> list[bpy.types.Image]:
    """Give what is clear its opacity as a picture, and return those: from Blender 5.2 on USD gets no number from it."""
    painted = []
    for material in materials:
        tree = material.node_tree
        for shader in [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"] if tree is not None else ():
            alpha = socket(shader.inputs, "Alpha")
            if not alpha.is_linked and alpha.default_value < 1:
                image = bpy.data.images.new(f"{material.name} Opacity", 4, 4, alpha=True)
                painted.append(image)
                image.pixels.foreach_set(np.tile(np.float32([0, 0, 0, alpha.default_value]), 16))
                image.pack()
                node = tree.nodes.new("ShaderNodeTexImage")
                node.image = image
                tree.links.new(socket(node.outputs, "Alpha"), alpha)
    return painted


def _unpack(folder: Path, materials) -> list[bpy.types.Image]:
    """Let the materials show files in ``folder`` in place of what they show; returns the images that do."""
    folder.mkdir()
    shown = {}
    for material in materials:
        for node in material.node_tree.nodes if material.node_tree is not None else ():
            if node.type == "TEX_IMAGE" and node.image is not None:
                if node.image not in shown:
                    shown[node.image] = _as_file(node.image, folder)
                node.image = shown[node.image] or node.image
    return [image for image in shown.values() if image is not None]


def _as_file(image: bpy.types.Image, folder: Path) -> bpy.types.Image | None:
    """An image that is read from a file of its own in ``folder``; None for what is no single file."""
    source = Path(bpy.path.abspath(image.filepath, library=image.library))
    if image.packed_file is not None:
        data = image.packed_file.data
    elif image.source == "FILE" and source.is_file():
        data = source.read_bytes()
    else:
        return None
    suffix = source.suffix or ".png"
    path = folder / (bpy.path.clean_name(image.name.removesuffix(suffix)) + suffix)
    while path.exists():
        path = path.with_stem(path.stem + "_")
    path.write_bytes(data)
    file = bpy.data.images.load(str(path), check_existing=False)
    file.colorspace_settings.name, file.alpha_mode = image.colorspace_settings.name, image.alpha_mode
    return file
