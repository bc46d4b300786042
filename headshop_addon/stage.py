# SPDX-License-Identifier: GPL-3.0-or-later
"""A portrait studio around a head: three lights, a backdrop, a camera, and render settings that work without a GPU.

Everything is placed from the head's own landmarks, so a scan in any pose is photographed alike.
"""

import contextlib
import json
import math
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..sim.errors import InputError
from .shader_nodes import Graph, socket

ROLE = "headshop_stage"
COLLECTION = "Head Shop Stage"
LENS_MM = 100.0

#: role -> (degrees to the image's right, degrees up, distance, (width, height), watts, colour). Lengths are in head
#: heights; watts are for a head of `USUAL_HEIGHT` and grow with its square.
LIGHTS = {
    "Key": (-32, 28, 4.6, (2.2, 2.2), 18.0, (1.0, 0.955, 0.90)),
    "Fill": (48, 2, 5.2, (4.4, 4.4), 5.0, (0.86, 0.93, 1.0)),
    "Rim": (160, 12, 4.0, (1.0, 3.2), 11.0, (0.90, 0.95, 1.0)),
    "Kicker": (-158, 8, 4.4, (0.9, 3.2), 8.0, (1.0, 0.96, 0.9)),
}
USUAL_HEIGHT = 0.225


@dataclass(frozen=True, eq=False)
class Portrait:
    """Where a head is and how it stands, in world metres.

    centre : (3,) middle between top of the head and chin, on the midline, at the depth of the eyes' outer corners
    left, back, up : (3,) unit vectors of the subject (right-handed: left x back = up)
    height : top of the head to chin
    """

    centre: np.ndarray
    left: np.ndarray
    back: np.ndarray
    up: np.ndarray
    height: float

    def point(self, right_deg: float, up_deg: float, distance: float) -> np.ndarray:
        """(3,) the point at this direction seen from the centre: 0, 0 is in front; to the *image's* right, and up."""
        a, b = math.radians(right_deg), math.radians(up_deg)
        # The image's right is the subject's left.
        direction = math.cos(b) * (math.sin(a) * self.left - math.cos(a) * self.back) + math.sin(b) * self.up
        return self.centre + distance * direction


def landmark_positions(skin_object) -> dict[str, np.ndarray]:
    """Skin landmark -> (3,) world metres, at rest (shape keys at zero).

    Raises
    ------
    InputError : the object is not the skin of a head.
    """
    document = skin_object.get("headshop_anatomy")
    if document is None:
        raise InputError(f"{skin_object.name!r} is not the skin of a Head Shop head: select the head's skin object.")
    points = json.loads(document)["landmarks"]
    rest = np.empty(len(skin_object.data.vertices) * 3, dtype=np.float32)
    keys = skin_object.data.shape_keys
    (keys.reference_key.points if keys else skin_object.data.vertices).foreach_get("co", rest)
    corners = np.array(points["corners"], dtype=int).reshape(-1, 3)
    local = np.einsum(
        "kij,ki->kj", rest.reshape(-1, 3)[corners].astype(float), np.array(points["weights"], dtype=float)
    )
    matrix = np.array(skin_object.matrix_world)
    world = local @ matrix[:3, :3].T + matrix[:3, 3]
    return dict(zip(points["names"], world, strict=True))


def portrait(skin_object) -> Portrait:
    """How the head stands: the Frankfurt horizontal through its tragia and orbitalia."""
    at = landmark_positions(skin_object)
    left = at["t_l"] - at["t_r"]
    left /= np.linalg.norm(left)
    forward = at["or_l"] + at["or_r"] - at["t_l"] - at["t_r"]
    forward -= left * (forward @ left)
    back = -forward / np.linalg.norm(forward)
    up = np.cross(left, back)
    middle = (at["ex_l"] + at["ex_r"]) / 2
    top, chin = ((at[name] - middle) @ up for name in ("v", "gn"))
    return Portrait(middle + up * (top + chin) / 2, left, back, up, float(top - chin))


def _looking(position: np.ndarray, target: np.ndarray, up: np.ndarray) -> Matrix:
    """The matrix of a camera or light at ``position`` that looks at ``target``."""
    z = position - target
    z /= np.linalg.norm(z)
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    return Matrix.Translation(Vector(position)) @ Matrix(np.column_stack([x, y, z]).tolist()).to_4x4()


def _own_collection(scene) -> bpy.types.Collection:
    for child in scene.collection.children:
        if child.get(ROLE):
            return child
    collection = bpy.data.collections.new(COLLECTION)
    collection[ROLE] = "stage"
    scene.collection.children.link(collection)
    return collection


def _own_object(collection, role: str, make_data) -> bpy.types.Object:
    for candidate in collection.objects:
        if candidate.get(ROLE) == role:
            return candidate
    made = bpy.data.objects.new("Head Shop " + role, make_data("Head Shop " + role))
    made[ROLE] = role
    collection.objects.link(made)
    return made


def aim_camera(
    scene, frame: Portrait, yaw: float = 12.0, pitch: float = 3.0, aspect: float = 0.83, close: bool = False
) -> None:
    """Put the scene's stage camera ``yaw`` degrees to the image's right of the face and ``pitch`` above it.

    aspect : width through height of the picture; the head always fills the same part of the height.
    close : come nearer for the face, with room for a dropped jaw, at the cost of the crown
    """
    camera = _own_object(_own_collection(scene), "Camera", bpy.data.cameras.new)
    camera.data.lens, camera.data.sensor_fit, camera.data.sensor_height = LENS_MM, "VERTICAL", 36.0
    # In head heights: from above the crown to the throat; a narrow picture must still hold both ears.
    top, bottom = (0.38, -0.77) if close else (0.60, -0.74)
    seen = frame.height * max(top - bottom, 0.95 / aspect)
    distance = seen * LENS_MM / 36.0 + 0.25 * frame.height
    target = frame.centre + frame.up * (top + bottom) / 2 * frame.height + frame.back * 0.28 * frame.height
    moved = Portrait(target, frame.left, frame.back, frame.up, frame.height)
    camera.matrix_world = _looking(moved.point(yaw, pitch, distance), target, frame.up)
    camera.data.clip_start, camera.data.clip_end = 0.05 * distance, 20 * distance
    scene.camera = camera


def light_head(scene, frame: Portrait, yaw: float = 0.0) -> None:
    """Three-point light: soft key, large fill, and two strips behind that draw the silhouette."""
    collection = _own_collection(scene)
    for role, (right, up, distance, size, watts, colour) in LIGHTS.items():
        light = _own_object(collection, role, lambda name: bpy.data.lights.new(name, "AREA"))
        light.data.shape = "RECTANGLE"
        light.data.size, light.data.size_y = (s * frame.height for s in size)
        light.data.energy = watts * (frame.height / USUAL_HEIGHT) ** 2
        light.data.color = colour
        position = frame.point(right + yaw, up, distance * frame.height)
        light.matrix_world = _looking(position, frame.centre, frame.up)


def backdrop() -> bpy.types.World:
    """A neutral studio backdrop: a soft glow behind the head for the camera, even dim light for everything else."""
    name = "Head Shop Backdrop"
    if name in bpy.data.worlds:
        return bpy.data.worlds[name]
    world = bpy.data.worlds.new(name)
    graph = Graph(world)
    window = socket(graph.node("TexCoord").outputs, "Window")
    away = graph.vector(
        "LENGTH", graph.vector("MULTIPLY", graph.vector("SUBTRACT", window, (0.5, 0.58, 0.0)), (1, 0.9, 0))
    )
    glow = graph.ramp(away, [(0.0, (0.165, 0.172, 0.185)), (0.35, (0.085, 0.09, 0.1)), (0.75, (0.028, 0.03, 0.034))])
    seen = graph.node("Background", {"Color": glow, "Strength": 1.0}).outputs[0]
    ambient = graph.node("Background", {"Color": (0.82, 0.9, 1.0, 1.0), "Strength": 0.09}).outputs[0]
    camera_ray = socket(graph.node("LightPath").outputs, "Is Camera Ray")
    shader = graph.node("MixShader", {0: camera_ray, 1: ambient, 2: seen}).outputs[0]
    graph.node("OutputWorld", {"Surface": shader})
    return world


def set_render(scene, width: int = 960, height: int = 1152, samples: int = 24, engine: str = "CYCLES") -> None:
    """Render settings: few samples and a denoiser, few bounces, no GPU needed; ``engine`` CYCLES or EEVEE.

    Eevee wants a GPU; Cycles is what works everywhere, headless too.
    """
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.film_transparent = False
    render.use_persistent_data = True
    render.use_motion_blur = False
    render.dither_intensity = 1.0
    render.threads_mode = "AUTO"
    if engine == "EEVEE":
        render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"
        scene.eevee.taa_render_samples = max(samples, 32)
    else:
        render.engine = "CYCLES"
        cycles = scene.cycles
        cycles.device = "CPU"
        cycles.samples = samples
        cycles.use_adaptive_sampling = True
        cycles.adaptive_threshold = 0.06
        cycles.adaptive_min_samples = 4
        cycles.use_light_tree = False  # four lights: plain sampling is faster
        try:
            cycles.denoiser = "OPENIMAGEDENOISE"
        except TypeError:  # a distribution's Blender may come without any denoiser: sample away the noise instead
            cycles.use_denoising, cycles.samples = False, 4 * samples
        else:
            cycles.use_denoising = True
            cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
            cycles.denoising_prefilter = "FAST"
        cycles.max_bounces = 4
        cycles.diffuse_bounces, cycles.glossy_bounces, cycles.transmission_bounces = 2, 2, 2
        cycles.transparent_max_bounces, cycles.volume_bounces = 6, 0
        cycles.caustics_reflective = cycles.caustics_refractive = False
        cycles.sample_clamp_indirect = 3.0
        cycles.blur_glossy = 1.0
        cycles.seed = 0
    view = scene.view_settings
    view.view_transform = "AgX"
    for look in ("AgX - Medium High Contrast", "Medium High Contrast", "None"):
        with contextlib.suppress(TypeError):  # the name of the look depends on the release's colour configuration
            view.look = look
            break
    view.exposure, view.gamma, view.use_curve_mapping = 0.0, 1.0, False


def set_stage(scene, skin_object, yaw: float = 12.0, pitch: float = 3.0, close: bool = False, **render) -> Portrait:
    """Light the head, put the camera before it and set the scene's render settings (see `set_render`).

    Stage objects of an earlier call are reused. Returns how the head stands.
    """
    frame = portrait(skin_object)
    set_render(scene, **render)
    aspect = scene.render.resolution_x / scene.render.resolution_y
    light_head(scene, frame)
    aim_camera(scene, frame, yaw, pitch, aspect, close)
    scene.world = backdrop()
    return frame
