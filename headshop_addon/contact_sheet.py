# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture that shows what a head is: its scan, skin, muscles and bones, and every expression."""

import math
from dataclasses import dataclass

import bpy
import numpy as np

from ..sim.errors import InputError
from ..sim.progress import Progress, Work
from . import heads, shape_keys
from .outputs import Outputs
from .pictures import grounded, render_picture, write_picture
from .stage import aim_camera
from .studio import Model, studio
from .text_labels import blend, put_text, rounded

PAGE, CARD = (0.055, 0.058, 0.064), (0.085, 0.089, 0.098)
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
    close: bool = False


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
    columns = max(4, min(8, math.ceil(math.sqrt(0.9 * len(shapes)))))
    width, height = tile or (1800 // columns, 2160 // columns)
    tiles, pictures = anatomy + shapes, []
    with Outputs() as outputs:
        target = outputs.file(path)
        with studio(skin, width=width, height=height, samples=samples, engine=engine) as (scene, frame):
            model = Model(scene, skin, frame)
            for number, each in enumerate(tiles):
                yield Progress(number / (len(tiles) + 1), f"Rendering {each.title}")
                model.show(*each.show)
                model.pose(each.key)
                aim_camera(scene, frame, each.yaw, aspect=width / height, close=each.close)
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
        points, sheets = (report.get("scan", {}).get(what) for what in ("points", "sheets"))
        if points:
            came = f"made of {points:,} points"
        elif sheets:
            came = f"{sheets} sheets, laid onto each other"
        else:
            came = f"{len(scan.data.polygons):,} triangles, as it came"
        tiles.append(Tile("Scan", came, ("scan",)))
    near = f"{fit['mean_mm']:.2f} mm from the scan on average" if "mean_mm" in fit else "ready to act"
    tiles.append(Tile("Head", near, ("skin", "features")))
    if muscles:
        tiles.append(
            Tile("Under the skin", "one anatomy for every head", ("half", "features", "bones", "muscles"), yaw=22.0)
        )
        tiles.append(
            Tile(
                "Muscles", f"{len(muscles)}, over skull and hinged jaw", ("features", "bones", "muscles"), yaw=SIDE_YAW
            )
        )
    if scan is None or not muscles:
        tiles.append(Tile("Skull", "hinged jaw", ("features", "bones"), yaw=SIDE_YAW))
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
        note = "" if peak is None else f"moves up to {peak:.0f} mm"
        tiles.append(Tile(title, note, ("skin", "features"), key, close=True))
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
    unit = width * columns / 1800  # all type and gaps follow the page
    kind = unit * min(4 / columns * 1.35, 1.0)  # captions follow the tiles
    gap, margin, head, section = (max(round(v * unit), 1) for v in (14, 52, 148, 62))
    strip = round(66 * kind)
    lines = [math.ceil(len(tiles) / columns) for _, tiles in rows]
    page_width = 2 * margin + columns * width + (columns - 1) * gap
    page_height = head + sum(section + n * (height + strip + gap) for n in lines) + margin - gap
    page = np.empty((page_height, page_width, 4), dtype=np.float32)
    page[..., :3], page[..., 3] = PAGE, 1.0
    put_text(page, name, margin - 2 * unit, 92 * unit, 52 * unit, INK)
    put_text(page, summary, margin, 128 * unit, 21 * unit, DIM)
    put_text(page, "Head Shop", page_width - margin, 92 * unit, 25 * unit, DIM, "right")
    shape = rounded(height + strip, width, 12 * unit)
    y = head
    for (title, tiles), n in zip(rows, lines, strict=True):
        put_text(page, title, margin, y + 0.62 * section, 23 * unit, INK)
        y += section
        for number, (tile, picture) in enumerate(tiles):
            row, column = divmod(number, columns)
            left, top = margin + column * (width + gap), y + row * (height + strip + gap)
            blend(page, shape, _card(picture, strip), left, top)
            foot = top + height + strip
            put_text(page, tile.title, left + 20 * kind, foot - (44 if tile.note else 30) * kind, 26 * kind, INK)
            put_text(page, tile.note, left + 20 * kind, foot - 18 * kind, 18 * kind, DIM)
        y += n * (height + strip + gap)
    return page


def _card(picture: np.ndarray, strip: int) -> np.ndarray:
    """The picture above an empty strip for the caption, darkened into it where the neck ends."""
    height, width = picture.shape[:2]
    card = np.empty((height + strip, width, 3), dtype=np.float32)
    card[:] = CARD
    card[:height] = grounded(picture, CARD)
    return card
