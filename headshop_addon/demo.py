# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job on the embedded sample, end to end: ``python -m headshop.headshop_addon.demo -o out/demo``.

Leaves ``sample/`` (scan, landmarks, truth), ``head.blend``, ``sheet.png`` and ``smile.mp4`` in the folder.
"""

import argparse
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from ..sim.errors import InputError
from ..sim.progress import finish
from .progress_bar import progress_bar

#: Small enough for two processor cores and no GPU to finish the demo in minutes.
SHEET = {"keys": ["joy", "sadness", "anger", "fear", "disgust", "surprise", "smile", "jaw_open"], "samples": 8}
FILM = {"size": (320, 360), "samples": 3}


def main(argv: list[str] | None = None) -> int:
    """Run the demo; returns the exit status (0 done, 2 the input is at fault, 130 interrupted)."""
    parser = argparse.ArgumentParser(prog="demo", description="Scan a sample subject, build its head, make it act.")
    parser.add_argument("-o", "--output", default="out/demo", metavar="DIR", help="(default: out/demo)")
    parser.add_argument("--seed", type=int, default=None, help="another subject")
    options = parser.parse_args(argv)
    try:
        run(Path(options.output), options.seed)
    except InputError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("demo: interrupted.", file=sys.stderr)
        return 130
    return 0


def run(folder: Path, seed: int | None = None) -> None:
    """Make everything in ``folder``, saying what was made and how long each step took."""
    from ..sim.acting.performance import sample_performance
    from ..sim.scan.sample import SEED, make_sample, write_sample

    start = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made ({error.strerror}): choose another folder.") from None
    with _step("scan") as say:
        sample = _finish(make_sample(SEED if seed is None else seed))
        scan_file, landmark_file, _ = write_sample(sample, folder / "sample")
        say(f"{scan_file}: {len(sample.scan.faces):,} triangles of a person who does not exist")

    from .headless import set_up_view, start_blender

    start_blender()
    from ..sim.adapt.landmarks import read_landmarks
    from . import baking, pipeline
    from .contact_sheet import render_sheet
    from .movie import render_movie

    with _step("build") as say:
        landmarks = read_landmarks(landmark_file)
        skin, report = _finish(pipeline.build_file(scan_file, landmarks, "Sample"))
        set_up_view(skin)
        fit, anatomy = report["fit"], report["anatomy"]
        say(f"head with {anatomy['muscles']} muscles, {fit['mean_mm']:.2f} mm from the scan on average")
    with _step("act") as say:
        made = _finish(baking.bake(skin, "expressions", sample_performance("smile")))
        say(baking.summary(made))
    with _step("save") as say:
        _save(folder / "head.blend")
        say(f"{folder / 'head.blend'}")
    with _step("sheet") as say:
        say(_finish(render_sheet(skin, folder / "sheet.png", **SHEET)))
    with _step("film") as say:
        say(_finish(render_movie(skin, folder / "smile.mp4", **FILM)))
    print(f"done in {time.perf_counter() - start:.0f} s")


@contextmanager
def _step(name: str):
    """Print what the step says it made, and its seconds."""
    start, said = time.perf_counter(), []
    yield said.append
    print(f"{name:6} {time.perf_counter() - start:5.1f} s   {'; '.join(map(str, said))}", flush=True)


def _finish(work):
    with progress_bar(True) as show:
        return finish(work, show)


def _scene():
    import bpy

    return bpy.context.scene


def _save(path: Path) -> None:
    from .headless import save
    from .outputs import Outputs

    with Outputs() as outputs:
        save(outputs.file(path))


if __name__ == "__main__":
    sys.exit(main())
