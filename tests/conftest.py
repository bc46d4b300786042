# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for all rooms: Blender (or a visible skip), a clean scene for each test, shared test data."""

import os
import shutil
import signal
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

_SETTINGS = pytest.StashKey[str]()


def pytest_configure(config):
    """Blender must not see the user's own settings and extensions: their wheels would shadow this environment's.

    A shell that starts the tests in the background has Ctrl-C ignored, and every process under it inherits that.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = tempfile.mkdtemp(prefix="headshop-tests-")
    config.stash[_SETTINGS] = folder
    os.environ["BLENDER_USER_RESOURCES"] = folder


def pytest_unconfigure(config):
    shutil.rmtree(config.stash.get(_SETTINGS, ""), ignore_errors=True)


def _empty_scene(bpy):
    """An empty file; the add-on stays as it is (`read_factory_settings` would disable it)."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture(scope="session")
def blender():
    """The bpy module for the whole session; skips where it is not installed."""
    return pytest.importorskip("bpy", reason="bpy (Blender as a Python module) is not installed")


@pytest.fixture
def bpy(blender):
    """The bpy module with an empty scene; skips where it is not installed."""
    _empty_scene(blender)
    return blender


@pytest.fixture
def addon(bpy, reference):
    """The bpy module with an empty scene and the extension enabled; disabled again afterwards."""
    import addon_utils

    assert addon_utils.enable("headshop", default_set=True) is not None
    yield bpy
    addon_utils.disable("headshop", default_set=True)


@pytest.fixture
def skin_object(addon, reference):
    """``skin_object(name)`` -> the reference's skin as an object in the scene."""
    from headshop.headshop_addon import bridge

    def make(name):
        obj = bridge.mesh_to_object(reference.skin, name)
        addon.context.scene.collection.objects.link(obj)
        return obj

    return make


@pytest.fixture
def scan_object(addon, skin_object):
    """The reference's skin as the chosen scan."""
    from headshop.headshop_addon import scan_landmarks

    obj = addon.context.scene.headshop.scan = skin_object("Scan")
    scan_landmarks.entries(obj)
    return obj


@pytest.fixture(autouse=True)
def _leave_no_scene_behind():
    """Tests that touched Blender leave an empty scene; tests of `sim` never import it."""
    yield
    blender = sys.modules.get("bpy")
    if blender is not None and (blender.data.filepath or len(blender.data.objects)):
        _empty_scene(blender)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of scans and measurements beside the checkout (or $HEADSHOP_SHARED); skips where it is absent."""
    folder = Path(os.environ.get("HEADSHOP_SHARED") or Path(__file__).resolve().parents[2] / "shared")
    if not (folder / "scans").is_dir():
        pytest.skip(f"no test data at {folder}: set HEADSHOP_SHARED to run this test")
    return folder


@pytest.fixture(scope="session")
def reference():
    """The reference head; skips while its file has not been generated."""
    from headshop.sim.anatomy import storage

    if not storage.REFERENCE.is_file():
        pytest.skip(f"no {storage.REFERENCE.name}: run python -m headshop.assets.generators.make_reference_head")
    return storage.reference_head()


@pytest.fixture(scope="session")
def seen_skin(reference):
    """``seen_skin(shut, eyeballs)`` -> the skin as a scanner sees it, the eyes on the sides ``shut`` shut, with the parts
    ``eyeballs``, as a surface, and its landmarks."""
    from headshop.sim.adapt.closest import Surface
    from headshop.sim.adapt.rest import rest_of
    from headshop.sim.adapt.shut_eyes import with_shut_eyes
    from headshop.sim.mesh_subdivision import drawn

    def make(shut=(), eyeballs=()):
        head = with_shut_eyes(reference, shut)
        target = Surface(drawn(head.skin.faces, head.skin.vertices), rest_of(reference).outer, smooth=2.0)
        for name in eyeballs:
            ball = reference.parts[name]
            target = target.beside(drawn(ball.faces, ball.vertices), ball.triangles)
        return target, head.landmark_positions()

    return make


@pytest.fixture(scope="session")
def laid():
    """``laid(space, points)`` -> the `ShapeFit` of a skin that has been laid at ``points`` (n, 3) mm, all of it trusted."""
    from headshop.sim.landmarks.pose_search import Pose
    from headshop.sim.landmarks.shape_fit import ShapeFit

    def make(space, points):
        n, modes = len(points), space.modes.shape[2]
        pose = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
        return ShapeFit(points, np.zeros(modes), pose, np.ones(n), np.zeros(n), np.zeros((modes, modes)))

    return make


@pytest.fixture(scope="session")
def bearded(reference):
    """``bearded(seed, deep, hanging)`` -> a person with a rough beard, ``deep`` mm, that hangs so many mm below the chin: the
    scan as a surface, the points (n, 3) mm of the skin below, its landmarks, and a face laid on all of the scan."""
    from functools import cache

    from headshop.sim.adapt.closest import Surface
    from headshop.sim.landmarks.beards import grows_beard
    from headshop.sim.landmarks.pose_search import Pose
    from headshop.sim.landmarks.shape_fit import fit_shape
    from headshop.sim.landmarks.shape_space import shape_space
    from headshop.sim.mesh import vertex_normals
    from headshop.sim.progress import finish
    from headshop.sim.scan.individual import draw_field

    @cache
    def make(seed, deep, hanging):
        space = shape_space(reference)
        points = space.points + draw_field(reference.landmark_positions(), np.random.default_rng(seed))(space.points)
        marks, beard = space.landmarks(points), grows_beard(space)
        rough = deep * (1 + 0.35 * np.random.default_rng(1).standard_normal(len(points)))
        worn = points + (beard * rough)[:, None] * vertex_normals(points, space.triangles)
        worn[:, 2] -= hanging * beard * np.clip((marks["li"][2] - points[:, 2]) / 40, 0, 1)
        target = Surface(worn, space.triangles, smooth=2.0)
        return target, points, marks, finish(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))

    return make


@pytest.fixture
def one_look(monkeypatch):
    """Faces are looked for once, quickly, and in one size, so that a scan without any is soon refused."""
    from headshop.sim.landmarks import any_size, looks, placed_face
    from headshop.sim.scan.units import sizes_to_try

    monkeypatch.setattr(any_size, "sizes_to_try", lambda samples: sizes_to_try(samples)[:1])
    monkeypatch.setattr(placed_face, "LOOKS", looks.LOOKS[:1])
    monkeypatch.setattr(placed_face, "PARTS", looks.PARTS[:1])


@pytest.fixture
def bad_scan(tmp_path):
    """``bad_scan(kind)`` -> path of a file: empty, text, missing, truncated, nothing, points, nan, one_triangle, whole."""
    import numpy as np

    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.ply import write_ply

    def make(kind: str) -> Path:
        path = tmp_path / f"{kind}.ply"
        if kind == "empty":
            path.write_bytes(b"")
        elif kind == "text":
            path.write_text("Dear scanner,\nthis is a letter, not a scan.\n")
        elif kind != "missing":
            side = np.arange(20.0) * 10
            points = np.stack([*np.meshgrid(side, side), 30 * np.cos(side / 40)[:, None] * np.cos(side / 40)], axis=-1)
            corner = np.arange(400).reshape(20, 20)
            faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1)
            points, faces = points.reshape(-1, 3), faces.reshape(-1, 4)
            points = points * np.nan if kind == "nan" else points
            points = points[:0] if kind == "nothing" else points
            faces = {"nothing": faces[:0], "points": faces[:0], "one_triangle": np.array([[0, 1, 20, -1]])}.get(
                kind, faces
            )
            write_ply(path, Mesh(points, faces.astype(np.int32)))
            if kind == "truncated":
                path.write_bytes(path.read_bytes()[:-1000])
        return path

    return make


@pytest.fixture
def write_rows():
    """``write_rows(path, encoding, elements, comments)`` -> path of a PLY file.

    elements : name -> (properties as the header says them, rows of numbers and of lists)
    """

    def write(path: Path, encoding: str, elements: dict, comments=("TextureFile skin.png",)) -> Path:
        header, body = ["ply", f"format {encoding} 1.0", *(f"comment {line}" for line in comments)], b""
        order = ">" if encoding == "binary_big_endian" else "<"
        codes = {"uchar": "B", "int": "i", "float": "f", "double": "d"}
        for name, (properties, rows) in elements.items():
            header += [f"element {name} {len(rows)}", *(f"property {line}" for line in properties)]
            for row in rows:
                numbers = []
                for line, value in zip(properties, row, strict=True):
                    kinds = line.split()[:-1]
                    if kinds[0] == "list":
                        numbers += [(kinds[1], len(value)), *((kinds[2], each) for each in value)]
                    else:
                        numbers.append((kinds[0], value))
                if encoding == "ascii":
                    body += (" ".join(f"{value:.9g}" for _, value in numbers) + "\n").encode()
                else:
                    body += b"".join(struct.pack(order + codes[kind], value) for kind, value in numbers)
        path.write_bytes(("\n".join(header) + "\nend_header\n").encode() + body)
        return path

    return write


@pytest.fixture(scope="session")
def reference_model(reference):
    """The reference head's tissue, built once; solving does not change it."""
    from headshop.sim.tissue.model import build_model

    return build_model(reference)


def _grid(count, width, height):
    from headshop.sim.mesh import Mesh

    x, y = np.meshgrid(*[np.linspace(-width / 2, width / 2, count)] * 2, indexing="ij")
    i = np.arange(count**2).reshape(count, count)
    faces = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    return Mesh(np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1), faces.astype(np.int32))


@pytest.fixture(scope="session")
def flat_patch():
    """Function of vertices a side and width (mm): a flat patch of skin, 8 mm over flat bone, with one muscle."""
    from headshop.sim.anatomy.head import PARTS, SKIN_GROUPS, Eye, Head, Jaw, Muscle, SurfacePoints
    from headshop.sim.mesh import Mesh

    def made(count, width):
        skin = _grid(count, width, 0.0)
        far = Mesh.from_triangles(np.array([[500.0, 500, 0], [510, 500, 0], [500, 510, 0]]), [[0, 1, 2]])
        groups = {name: np.zeros(len(skin.vertices), np.float32) for name in SKIN_GROUPS}
        groups["face"] = (np.abs(skin.vertices[:, :2]).max(axis=1) < width / 2 - 1).astype(np.float32)
        fibre = np.linspace([-25.0, 0, -6], [20, 0, -4], 6)
        fibres = np.stack([fibre + [0, y, 0] for y in (-3, 0, 3)])
        points = SurfacePoints((), (), np.zeros((0, 3), int), np.zeros((0, 3)))
        return Head(
            parts={**dict.fromkeys(PARTS, far), "skin": skin, "skull": _grid(17, 120.0, -8.0)},
            groups=groups,
            landmarks=points,
            skull_landmarks=points,
            feature_mesh=np.zeros((0, 3), int),
            muscles=(Muscle("zygomaticus_major_l", "linear", fibres, 9.0, 2.0, 0.35, "skull", "soft", far),),
            jaw=Jaw(np.array([50.0, 0, -60]), np.array([-50.0, 0, -60]), np.array([0, -80.0, -90])),
            eyes=(Eye(np.array([500.0, 0, 0]), 12.0, np.array([0, -1.0, 0])),) * 2,
        )

    return made


#: What NumPy reckons in another way, number by number, where input and output might overlap.
TWOFOLD = (
    "arctan2 sin cos tan arcsin arccos arctan sinh cosh tanh exp exp2 expm1 log log2 log10 log1p cbrt power".split()
)


@pytest.fixture
def strided(monkeypatch):
    """(module, function) of each call from Head Shop's own code with an array of numbers that do not lie together."""
    found = set()

    def watched(name, function):
        def call(*args, **kwargs):
            module = sys._getframe(1).f_globals["__name__"]
            arrays = [x for x in args if isinstance(x, np.ndarray) and x.size > 1]
            if module.startswith("headshop.") and any(
                not (x.flags.c_contiguous or x.flags.f_contiguous) for x in arrays
            ):
                found.add((module, name))
            return function(*args, **kwargs)

        return call

    for name in TWOFOLD:
        monkeypatch.setattr(np, name, watched(name, getattr(np, name)))
    return found
