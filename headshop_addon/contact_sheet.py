# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture that shows what a head is: its scan, skin, muscles and bones, and every expression."""

from dataclasses import dataclass

import bpy
import numpy as np

from ..sim.errors import InputError
from ..sim.progress import Progress, Work
from . import heads, shape_keys
from .outputs import Outputs
from .pictures import render_picture, write_picture
from .stage import aim_camera
from .studio import Model, studio
from .text_labels import blend, put_text, rounded

PAGE = (0.055, 0.058, 0.064)
INK, DIM = (0.95, 0.95, 0.94, 1.0), (0.95, 0.95, 0.94, 0.55)
YAW, SIDE_YAW = 12.0, 30.0
FIRST = ("joy", "sadness", "anger", "fear", "disgust", "surprise", "smile", "jaw_open")


@dataclass(frozen=True)
class Tile:
    """One picture of the sheet: which sets of parts are shown, in which pose, from where."""

    title: str
    note: str
    show: tuple[str, ...]
    key: str = ""
    yaw: float = YAW


def render_sheet(
    skin: bpy.types.Object,
    path,
    keys: list[str] | None = None,
    tile: tuple[int, int] | None = None,
    samples: int = 16,
    engine: str = "CYCLES",
) -> Work:
    """Render the sheet into a PNG file; returns its path.

    Parameters
    ----------
    keys : shape keys of the skin to show, in this order; by default the baked expressions, or all that was baked
    tile : width and height of one picture in pixels; by default as suits their number

    Raises
    ------
    InputError : not a head, or a key is not there.
    """
    anatomy, shapes = anatomy_tiles(skin), shape_tiles(skin, default_keys(skin) if keys is None else keys)
    columns = max(4, min(8, int(np.ceil(np.sqrt(0.9 * len(shapes))))))
    width, height = tile or ((480, 560) if columns == 4 else (1920 // columns // 2 * 2, 2240 // columns // 2 * 2))
    tiles, pictures = anatomy + shapes, []
    with Outputs() as outputs:
        target = outputs.file(path)
        with studio(skin, width=width, height=height, samples=samples, engine=engine) as (scene, frame):
            model = Model(scene, skin, frame)
            for number, each in enumerate(tiles):
                yield Progress(number / (len(tiles) + 1), f"Rendering {each.title}")
                model.show(*each.show)
                model.pose(each.key)
                aim_camera(scene, frame, each.yaw, aspect=width / height)
                pictures.append(render_picture(scene)[..., :3])
        yield Progress(len(tiles) / (len(tiles) + 1), "Composing the sheet")
        rows = [("From scan to anatomy", list(zip(anatomy, pictures, strict=False)))]
        if shapes:
            rows.append(
                ("Expressions, simulated muscle by muscle", list(zip(shapes, pictures[len(anatomy) :], strict=True)))
            )
        write_picture(target, compose(heads.head_name(skin), _summary(skin), rows, columns))
    return path


def anatomy_tiles(skin: bpy.types.Object) -> list[Tile]:
    """The scan if it is still there, the head, and what is under its skin."""
    report = heads.read_report(skin)
    scan, fit, muscles = heads.scan_of(skin), report.get("fit", {}), heads.muscles_of(skin)
    tiles = []
    if scan is not None:
        tiles.append(Tile("Scan", f"{len(scan.data.polygons):,} triangles, as it came", ("scan",)))
    near = f"{fit['mean_mm']:.2f} mm from the scan on average" if "mean_mm" in fit else "ready to act"
    tiles.append(Tile("Head", near, ("skin", "eyes", "bones")))
    if muscles:
        tiles.append(
            Tile("Under the skin", "one anatomy for every head", ("half", "eyes", "bones", "muscles"), yaw=22.0)
        )
        tiles.append(Tile("Muscles", f"{len(muscles)} that pull", ("eyes", "bones", "muscles"), yaw=SIDE_YAW))
    if scan is None or not muscles:
        tiles.append(Tile("Skull", "hinged jaw", ("eyes", "bones"), yaw=SIDE_YAW))
    return tiles


def default_keys(skin: bpy.types.Object) -> list[str]:
    """The baked expressions, the six basic ones first; without any, all baked shapes."""
    from ..sim.acting.expressions import expressions

    baked = shape_keys.baked_names(skin)
    known = expressions()
    chosen = [name for name in baked if name in known] or baked
    return sorted(chosen, key=lambda name: FIRST.index(name) if name in FIRST else len(FIRST))


def shape_tiles(skin: bpy.types.Object, keys: list[str]) -> list[Tile]:
    """One tile for each shape key.

    Raises
    ------
    InputError : a key is not there.
    """
    blocks = skin.data.shape_keys.key_blocks if skin.data.shape_keys else ()
    report = shape_keys.baked_report(skin)
    tiles = []
    for key in keys:
        if key not in blocks:
            raise InputError(f"{skin.name!r} has no shape key {key!r}: bake it first.")
        peak = report.get(key, {}).get("peak_mm")
        title = key.replace("_", " ").capitalize() if key.islower() else key
        tiles.append(Tile(title, "" if peak is None else f"moves up to {peak:.0f} mm", ("skin", "eyes", "bones"), key))
    return tiles


def _summary(skin: bpy.types.Object) -> str:
    """A line for the sheet's head: what this one consists of."""
    pieces = [f"{len(skin.data.vertices):,} skin vertices", f"{len(heads.muscles_of(skin))} muscles"]
    baked = len(shape_keys.baked_names(skin))
    return "   ·   ".join(pieces + ([f"{baked} baked shapes"] if baked else []))


def compose(name: str, summary: str, rows, columns: int) -> np.ndarray:
    """The page (h, w, 4): a heading, then sections of captioned tiles.

    rows : sections (title, [(`Tile`, picture (h, w, 3)), …])
    """
    height, width = rows[0][1][0][1].shape[:2]
    unit = width * columns / 1920  # all type and gaps follow the page
    gap, margin, head, section = (max(int(round(v * unit)), 1) for v in (14, 56, 150, 64))
    lines = [int(np.ceil(len(tiles) / columns)) for _, tiles in rows]
    page_width = 2 * margin + columns * width + (columns - 1) * gap
    page_height = head + sum(section + n * (height + gap) for n in lines) + margin - gap
    page = np.empty((page_height, page_width, 4), dtype=np.float32)
    page[..., :3], page[..., 3] = PAGE, 1.0
    put_text(page, name, margin, 0.62 * head, 54 * unit, INK)
    put_text(page, "Head Shop", page_width - margin, 0.62 * head, 26 * unit, DIM, "right")
    put_text(page, summary, margin, 0.62 * head + 38 * unit, 22 * unit, DIM)
    shape = rounded(height, width, 12 * unit)
    y = head
    for (title, tiles), n in zip(rows, lines, strict=True):
        put_text(page, title, margin, y + 0.62 * section, 24 * unit, INK)
        y += section
        for number, (tile, picture) in enumerate(tiles):
            row, column = divmod(number, columns)
            left, top = margin + column * (width + gap), y + row * (height + gap)
            blend(page, shape, _grounded(picture), left, top)
            scale = unit if columns == 4 else 1.25 * unit
            put_text(
                page, tile.title, left + 22 * scale, top + height - (46 if tile.note else 26) * scale, 27 * scale, INK
            )
            put_text(page, tile.note, left + 22 * scale, top + height - 20 * scale, 18 * scale, DIM)
        y += n * (height + gap)
    return page


def _grounded(picture: np.ndarray) -> np.ndarray:
    """The picture darkened towards its foot, where the neck ends and the caption stands."""
    height = len(picture)
    fall = np.clip((np.arange(height) / height - 0.72) / 0.26, 0, 1)
    fall = (fall * fall * (3 - 2 * fall)).astype(np.float32)[:, None, None]
    return picture + fall * (np.array(PAGE, dtype=np.float32) * 1.35 - picture)
