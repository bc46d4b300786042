# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist sets and the .blend keeps: ``Scene.headshop`` and ``Object.headshop``.

The sliders (``Object.headshop.muscles``, ``.controls``, on the skin object) are made from the reference head's muscles
when the extension is enabled: one animatable property each.
"""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
)

from ..sim.adapt.fit_colour import LIMIT
from . import detail_images, heads, heat_map, live, muscle_names
from .class_registry import register_all, unregister_all

#: How a landmark got its place.
STATES = (
    ("MISSING", "Missing", "Not placed yet", "BLANK1", 0),
    ("DERIVED", "Estimated", "Carried over from the reference head by the landmarks already placed", "KEYFRAME", 1),
    ("PLACED", "Placed", "Placed by hand or read from a file", "KEYFRAME_HLT", 2),
    ("FOUND", "Found", "Found on the scan by its shape", "HANDLETYPE_AUTO_CLAMP_VEC", 3),
)


#: How fine detail is shown.
DETAIL = (
    ("NONE", "None", "The smooth skin alone"),
    ("NORMAL", "Normal Map", "Shading shows the detail; costs next to nothing"),
    ("DISPLACEMENT", "Displacement", "The rendered surface itself is moved; silhouettes show the detail too"),
)


#: What moves the face under the sliders.
MODELS = (
    ("SIMULATED", "Simulated", "Tissue that muscles pull on comes to rest; what a bake keeps", "NONE", 0),
    ("INSTANT", "Instant", "What was learnt of the simulation when the preview was prepared; at once", "NONE", 2),
    ("DIRECT", "Direct", "Muscles displace the skin itself (Waters 1987); at once, a preview", "NONE", 1),
)


#: Which faces are relaxed when a head is built.
RELAX = (
    ("AUTO", "Parted Lips", "Relax a face whose lips are parted"),
    ("ALWAYS", "Always", "Relax any face, one that smiles with closed lips too"),
    ("NEVER", "Never", "Keep the face as scanned"),
)

#: What of a scan is left out when a head is built, as no skin: `sim.adapt.scan_surface.NO_SKIN`.
NO_SKIN = (
    ("DEPTH_JUMPS", "Depth Jumps", "Leave out what a depth map has stretched from the head to the wall behind it"),
    ("FLAT_ENDS", "Flat Ends", "Leave out where tomography stops or a bust stands on its base"),
    ("HELD_BY_LIPS", "Held by Lips", "Leave out what the lips hold, such as a breathing tube"),
    ("HAIR", "Hair", "Leave out hair of the head, a fringe or a cap; scalp and forehead are invented below it"),
    ("GLASSES", "Glasses", "Leave out glasses; what they hide is invented"),
    ("BEARD", "Beard", "Leave out a beard; chin and cheeks are invented below it"),
    (
        "CLOTHING",
        "Clothing",
        "Leave out clothes about the neck, as their colours tell; the neck is invented below them",
    ),
)


def _on_detail(group, _context):
    detail_images.show(group.id_data, group.detail)


def _on_show_fit(group, _context):
    heat_map.show(group.id_data, group.show_fit, group.fit_range)
    heat_map.solid_views(group.show_fit)


def _on_fit_range(group, _context):
    if group.show_fit and heat_map.has_fit(group.id_data):
        heat_map.paint(group.id_data, group.fit_range)


def _is_scan(group, obj):
    return obj.type == "MESH" and obj.get(heads.PART) == "scan" and obj.name in group.id_data.objects


def _is_skin(group, obj):
    return heads.is_skin(obj) and obj.name in group.id_data.objects


class HEADSHOP_PG_landmark(bpy.types.PropertyGroup):
    """One landmark of a scan; ``name`` is its short name, such as ``prn``."""

    co: FloatVectorProperty(name="Position", description="In the scan object's own space", size=3, subtype="XYZ")
    state: EnumProperty(name="State", items=STATES)
    found: FloatVectorProperty(
        name="Found", description="Where it was found, before any correction", size=3, subtype="XYZ"
    )
    confidence: FloatProperty(name="Confidence", description="How sure a found landmark is", min=0.0, max=1.0)
    mid_air: BoolProperty(name="In Mid-Air", description="The scan shows nothing where it lies")


class _Sliders:
    """Read all sliders of a group at once."""

    def values(self) -> dict[str, float]:
        """Slider name -> value."""
        return {name: getattr(self, name) for name in self.bl_rna.properties.keys() if name not in ("rna_type", "name")}


def _slider(label: str, description: str, lowest: float):
    return FloatProperty(
        name=label,
        description=description,
        min=lowest,
        max=1.0,
        default=0.0,
        precision=2,
        step=1,
        subtype="FACTOR" if lowest == 0.0 else "NONE",  # a bar half full would not look like rest
        options={"ANIMATABLE"},
        override={"LIBRARY_OVERRIDABLE"},
        update=live.on_slider,
    )


class HEADSHOP_PG_muscles(_Sliders, bpy.types.PropertyGroup):
    """Contraction of every muscle, 0 to 1."""


class HEADSHOP_PG_controls(_Sliders, bpy.types.PropertyGroup):
    """Jaw, lids and gaze."""


class HEADSHOP_PG_object(bpy.types.PropertyGroup):
    """Landmarks of a scan; sliders of a head's skin."""

    landmarks: CollectionProperty(type=HEADSHOP_PG_landmark)
    landmark_index: IntProperty(name="Landmark", description="The landmark chosen in the list", default=-1)
    muscles: PointerProperty(type=HEADSHOP_PG_muscles, override={"LIBRARY_OVERRIDABLE"})
    controls: PointerProperty(type=HEADSHOP_PG_controls, override={"LIBRARY_OVERRIDABLE"})
    live: BoolProperty(
        name="Live",
        description="The face follows the sliders. Off: the sliders move nothing, baked shape keys play alone",
        default=True,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=live.on_switch,
    )
    model: EnumProperty(
        name="Model",
        description="What moves the face under the sliders. Bakes are always simulated",
        items=MODELS,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=live.on_model,
    )
    dynamics: BoolProperty(
        name="Dynamics",
        description="In Keyed Sliders to Animation, flesh swings: it feels the scene's gravity, the motion of the head's "
        "object and wind. Off: it comes to rest in every frame",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    wind: FloatVectorProperty(
        name="Wind",
        description="Where the air goes and how fast, along the scene's axes",
        size=3,
        subtype="VELOCITY",
        unit="VELOCITY",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    turbulence: FloatProperty(
        name="Turbulence",
        description="By what share of its speed the wind fluctuates",
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    wind_seed: IntProperty(
        name="Seed",
        description="Another seed, other gusts",
        min=0,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    detail: EnumProperty(
        name="Detail",
        description="How the scan's fine detail is shown, which the mesh cannot follow",
        items=DETAIL,
        default="NORMAL",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_on_detail,
    )
    show_fit: BoolProperty(
        name="Show Fit",
        description="Colour the skin by its distance from the scan: blue inside, red outside, grey where it was invented",
        default=False,
        options=set(),
        update=_on_show_fit,
    )
    fit_range: FloatProperty(
        name="Range",
        description="Distance from the scan at the ends of the colour scale, in millimetres",
        default=LIMIT,
        min=0.01,
        soft_min=0.1,
        soft_max=5.0,
        max=100.0,
        precision=2,
        step=10,
        options=set(),
        update=_on_fit_range,
    )


class HEADSHOP_PG_scene(bpy.types.PropertyGroup):
    """Settings of the sidebar."""

    scan: PointerProperty(
        name="Scan",
        description="The scan that landmarks are placed on. Use Selected makes one of other meshes",
        type=bpy.types.Object,
        poll=_is_scan,
    )
    head: PointerProperty(
        name="Head", description="The head that sliders and bakes work on", type=bpy.types.Object, poll=_is_skin
    )
    show_landmarks: BoolProperty(name="Show Landmarks", description="Draw landmarks in the viewport", default=True)
    relax: EnumProperty(
        name="Relax",
        description="When to make the scanned face neutral; the face as scanned is kept as the shape key Scan",
        items=RELAX,
    )
    no_skin: EnumProperty(
        name="Leave Out",
        description="What of the scan is not to be fitted; the skin is invented there",
        items=NO_SKIN,
        default={name for name, *_ in NO_SKIN},
        options={"ENUM_FLAG"},
    )
    show_names: BoolProperty(name="Names", description="Write each placed landmark's name beside it", default=True)


_CLASSES = (
    HEADSHOP_PG_landmark,
    HEADSHOP_PG_muscles,
    HEADSHOP_PG_controls,
    HEADSHOP_PG_object,
    HEADSHOP_PG_scene,
)


def register():
    """Make the sliders and attach the groups to scenes and objects."""
    HEADSHOP_PG_muscles.__annotations__ = {
        name: _slider(muscle_names.label(name), f"Contraction of {muscle_names.label(name).lower()}", 0.0)
        for name in muscle_names.muscles()
    }
    HEADSHOP_PG_controls.__annotations__ = {
        name: _slider(label, description, lowest)
        for name, (label, lowest, description) in muscle_names.CONTROLS.items()
    }
    register_all(_CLASSES)
    bpy.types.Object.headshop = PointerProperty(type=HEADSHOP_PG_object, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.Scene.headshop = PointerProperty(type=HEADSHOP_PG_scene)


def unregister():
    """Detach and forget; the values stay in the .blend and come back when the extension does."""
    del bpy.types.Scene.headshop
    del bpy.types.Object.headshop
    unregister_all(_CLASSES)
