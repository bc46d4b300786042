# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact sheets to judge the reference head by: ``python -m headshop.assets.generators.sheets DIR [--head FILE]``.

Each sheet shows one thing from several sides; ``--only skin,lips`` draws some of them, ``--beside SCAN.ply`` puts a
real head beside the skin. No Blender needed; a sheet takes a few seconds.
"""

import argparse
import sys
from functools import cached_property
from pathlib import Path

import numpy as np

from ...sim.acting.plain_posing import plainly_posed
from ...sim.anatomy.head import Head
from ...sim.anatomy.storage import load_head
from ...sim.mesh import Mesh
from ...sim.scan.viewpoint import Viewpoint
from .picture import Layer, draw, montage, write_png
from .sheet_layers import (
    SKIN,
    bone_layers,
    cornea_layer,
    eye_layers,
    feature_layer,
    mark_layer,
    mouth_layers,
    muscle_layers,
    part_layer,
    skin_layer,
    texture_layer,
)

#: (yaw toward the subject's left, pitch up) in degrees.
SIX = ((0, 0), (40, 5), (90, 0), (145, 8), (25, -38), (20, 45))
FOUR = ((0, 0), (40, 5), (90, 0), (20, -30))


def camera(target, yaw, pitch, field, pixels, distance=900.0) -> Viewpoint:
    """A camera on ``target`` (3,) mm whose square picture covers ``field`` mm with ``pixels``."""
    return Viewpoint.around(target, np.radians(yaw), np.radians(pitch), distance, field / pixels, field, field)


class Sheets:
    """The sheets of one head: each public method draws one, (h, w, 3) sRGB 0..1.

    pixels : width of one picture; beside : a scan (mm, in the head's own place) for the sheet of that name
    """

    def __init__(self, head: Head, pixels: int = 420, beside: Mesh | None = None):
        self.head, self.pixels, self.scan = head, pixels, beside
        self.marks = head.landmark_positions()
        self.eyes, self.teeth = eye_layers(head), mouth_layers(head)
        self.lip_middle = (self.marks["ch_l"] + self.marks["ch_r"]) / 2

    @cached_property
    def plain(self) -> Layer:
        """The skin's limit surface."""
        return skin_layer(self.head.skin, groups=self.head.groups)

    @cached_property
    def wired(self) -> Layer:
        """The same with the edges of the cage."""
        return skin_layer(self.head.skin, wire=True, groups=self.head.groups)

    def _row(self, layers, target, field, views, larger=1.0):
        pixels = int(larger * self.pixels)
        return [draw(layers, camera(target, yaw, pitch, field, pixels)) for yaw, pitch in views]

    def _six(self, layers, target, field, views=SIX, larger=1.0):
        pictures = self._row(layers, target, field, views, larger)
        half = (len(pictures) + 1) // 2
        return montage([pictures[:half], pictures[half:]])

    def _close(self, target, field, views, more=()):
        """Shaded above, wire below."""
        return montage([self._row([skin, *more], target, field, views) for skin in (self.plain, self.wired)])

    def _whole(self):
        low, high = self.head.skin.vertices[:, 2].min(), self.marks["v"][2]
        return np.array([0.0, -5.0, (low + high) / 2]), high - low + 40

    def skin(self):
        """Skin from six sides."""
        return self._six([self.plain, *self.eyes], *self._whole())

    def wire(self):
        """Skin with its edges from six sides."""
        return self._six([self.wired, *self.eyes], *self._whole(), larger=1.4)

    def face(self):
        """The face, larger."""
        return self._six([self.plain, *self.eyes, *self.teeth], [0, -40, -15], 190, SIX[:3] + SIX[4:5], 1.4)

    def facewire(self):
        """The face with its edges, larger."""
        return self._six([self.wired, *self.eyes], [0, -40, -15], 170, SIX[:2], 1.8)

    def landmarks(self):
        """The landmarks on the skin, and the feature mesh that joins them."""
        dots = mark_layer(np.array(list(self.marks.values())))
        views = ((0, 0), (45, 5), (90, 0), (25, -38))
        features = feature_layer(self.head)
        return montage([self._row(layers, [0, -20, 15], 250, views) for layers in ([self.plain, dots], [features])])

    def texture(self):
        """The texture square; bluer where there are more texels per mm."""
        return draw([texture_layer(self.head.skin)], camera([0, 0, 0], 0, 0, 204, 3 * self.pixels))

    def eye(self):
        """The left eye."""
        return self._close(self.head.eyes[0].centre, 50, ((0, 0), (45, 0), (-35, 5), (10, -35)), self.eyes)

    def ear(self):
        """The left ear."""
        target = (self.marks["sa_l"] + self.marks["sba_l"]) / 2
        return self._close(target, 85, ((90, 0), (50, 0), (140, 5), (100, 35)))

    def nose(self):
        """The nose."""
        return self._close(self.marks["prn"], 70, ((0, 0), (40, 5), (90, 0), (0, -50)))

    def lips(self):
        """The closed mouth."""
        return self._close(self.lip_middle, 80, ((0, 0), (40, 0), (90, 0), (0, -40)), self.teeth)

    def skull(self):
        """Bones and teeth."""
        return self._six(bone_layers(self.head) + self.teeth, [0, -10, 5], 250)

    def muscles(self):
        """Muscles over the bones."""
        layers = [*muscle_layers(self.head), *bone_layers(self.head), *self.eyes, *self.teeth]
        low = min(muscle.shape.vertices[:, 2].min() for muscle in self.head.muscles)
        return self._six(layers, [0, -10, (low + self.marks["v"][2]) / 2], self.marks["v"][2] - low + 20)

    def facemuscles(self):
        """The muscles of the face, larger: all of them above, the deep ones below."""
        rest = [*bone_layers(self.head), *self.eyes, *self.teeth]
        views = ((0, 0), (40, 5), (85, 0), (15, -35))
        return montage(
            [
                self._row([*muscle_layers(self.head, least), *rest], [0, -45, -8], 175, views, 1.5)
                for least in (0.0, 2.5)
            ]
        )

    def rows(self):
        """Both rows of teeth."""
        views = ((0, 0), (45, 0), (90, 0), (0, 50), (0, -50), (180, 10))
        return self._six(self.teeth[:2], self.lip_middle + [0, 25, 0], 90, views)

    def tongue(self):
        """Tongue in the lower row."""
        views = ((0, 30), (45, 30), (90, 0), (0, 80), (0, -50), (180, 30))
        return self._six(self.teeth[1:], self.lip_middle + [0, 25, -5], 100, views)

    def eyeballs(self):
        """The left eyeball by itself."""
        return montage(
            [
                self._row(
                    [part_layer(self.head, "eye_l"), cornea_layer(self.head, "l")], self.head.eyes[0].centre, 32, FOUR
                )
            ]
        )

    def poses(self):
        """Jaw and lids turned plainly, without simulation: shut, half, wide open."""
        target = np.array([0.0, -40.0, (self.marks["n"][2] + self.marks["gn"][2]) / 2 - 15])
        rows = []
        for pose in ({"blink": 1.0}, {"blink": 0.5, "jaw_open": 0.5}, {"jaw_open": 1.0}):
            posed = plainly_posed(self.head, **pose)
            layers = [skin_layer(posed.skin, groups=posed.groups), *eye_layers(posed), *mouth_layers(posed)]
            rows.append(self._row(layers, target, 210, FOUR))
        return montage(rows)

    def blink(self):
        """The left eye open, half shut, shut, looking down, up and aside; from the front, the sides and below."""
        rows = []
        for blink, gaze in ((0, (0, 0)), (0.5, (0, 0)), (1, (0, 0)), (0, (0, -0.43)), (0, (0, 0.3)), (0, (0.6, 0))):
            posed = plainly_posed(self.head, blink=blink, gaze=gaze)
            layers = [skin_layer(posed.skin, levels=3, groups=posed.groups), *eye_layers(posed)]
            rows.append(self._row(layers, self.head.eyes[0].centre, 46, ((0, 0), (45, 0), (-35, 5), (10, -35))))
        return montage(rows)

    def mouth(self):
        """The mouth opened by the jaw alone, a third, half and wide; pushed aside and forward."""
        target = self.lip_middle * [0, 1, 1] + [0, 8, -18]
        rows = []
        for pose in ({"jaw_open": 0.3}, {"jaw_open": 0.6}, {"jaw_open": 1.0}, {"jaw_side": 1.0}, {"jaw_forward": 1.0}):
            posed = plainly_posed(self.head, **pose)
            layers = [skin_layer(posed.skin, groups=posed.groups), *mouth_layers(posed)]
            rows.append(self._row(layers, target, 110, ((0, 0), (40, 5), (90, 0), (0, -40), (15, 30))))
        return montage(rows)

    def beside(self):
        """The skin above, a real head below."""
        if self.scan is None:
            raise SystemExit("The sheet 'beside' needs a scan: --beside SCAN.ply")
        colour = SKIN if self.scan.colour is None else self.scan.colour
        scan = Layer(self.scan.vertices, self.scan.triangles, colour)
        return montage([self._row(layers, [0, -10, -20], 290, SIX) for layers in ([self.plain, *self.eyes], [scan])])


SHEETS = (
    *("skin", "wire", "face", "facewire", "eye", "ear", "nose", "lips", "skull", "muscles", "rows", "tongue"),
    *("eyeballs", "blink", "poses", "mouth", "landmarks", "texture"),
    "facemuscles",
)


def main(argv: list[str]) -> int:
    """Draw the sheets into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--head", type=Path, help="another head file than the shipped one")
    parser.add_argument("--only", default="", help=f"some of: {', '.join((*SHEETS, 'beside'))}")
    parser.add_argument("--beside", type=Path, help="a scan (PLY, mm, in the head's own place) to put beside the skin")
    parser.add_argument("--pixels", type=int, default=420, help="width of one picture")
    chosen = parser.parse_args(argv)
    beside = None
    if chosen.beside:
        from ...sim.scan.ply import read_ply

        beside = read_ply(chosen.beside)
    names = chosen.only.split(",") if chosen.only else [*SHEETS, *(["beside"] if beside else [])]
    unknown = [name for name in names if name not in (*SHEETS, "beside")]
    if unknown:
        parser.error(f"there is no sheet {unknown[0]!r}: choose from {', '.join(SHEETS)}")
    chosen.folder.mkdir(parents=True, exist_ok=True)
    sheets = Sheets(load_head(chosen.head) if chosen.head else load_head(), chosen.pixels, beside)
    for name in names:
        write_png(chosen.folder / f"{name}.png", getattr(sheets, name)())
        print(chosen.folder / f"{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
