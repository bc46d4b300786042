# SPDX-License-Identifier: GPL-3.0-or-later
"""The program ``headshop``: what it understands and how it ends. What the commands do is in `commands`.

Exit status: 0 done, 2 the input is at fault, 1 our own fault, 130 interrupted; with anything but 0, one sentence on
stderr and no file left behind.
"""

import argparse
import os
import signal
import sys
from contextlib import contextmanager

from ..sim.acting import models
from ..sim.errors import InputError

INTERRUPTED = 130
RELAX = ("auto", "always", "never")
SETS = ("muscles", "facs", "arkit", "expressions", "rig")


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of reciting the usage."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help).\n")


def parser() -> argparse.ArgumentParser:
    """The commands and options of DESIGN section 5."""
    program = _Parser(
        prog="headshop", description="A raw scan of a head goes in, a head that acts comes out.", allow_abbrev=False
    )
    program.add_argument("--version", action="store_true", help="print the versions of Head Shop and Blender")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="on errors, show where in the program they happened")
    common.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    plain = argparse.ArgumentParser(add_help=False)
    plain.add_argument("--export", metavar="DIR", help="also write plain files (PLY, JSON, NPZ; mm) into DIR")
    chosen = argparse.ArgumentParser(add_help=False)
    chosen.add_argument("head", metavar="HEAD.blend", help="a file that headshop build or the add-on made")
    chosen.add_argument("--head", dest="name", metavar="NAME", help="which head, if the file holds several")
    reading = argparse.ArgumentParser(add_help=False)
    reading.add_argument("scan", metavar="SCAN", help="PLY, OBJ, STL, glTF, USD, FBX, or a range map (ECH, NPZ, JSON)")
    about = "the scan's unit: mm, cm, m, in, or millimetres per unit as a number (default: detected)"
    reading.add_argument("--units", type=_unit, metavar="UNIT", help=about)
    up = "the scan's up axis: X, Y, Z or, written --up=-Z, one upside down (default: detected)"
    reading.add_argument("--up", choices=("X", "Y", "Z", "-X", "-Y", "-Z"), metavar="AXIS", help=up)

    commands = program.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    def command(name, about, *parents):
        return commands.add_parser(name, help=about, description=about, parents=[*parents, common], allow_abbrev=False)

    build = command("build", "Turn a scan into an animatable head.", reading, plain)
    build.add_argument("--landmarks", metavar="FILE", help="landmark file (default: found automatically)")
    sizes = (0, 512, 1024, 2048, 4096)
    about = "pixels along a side of the displacement and normal map, 0 for none (default: 1024)"
    build.add_argument("--detail", type=int, choices=sizes, default=1024, metavar="SIZE", help=about)
    build.add_argument("--name", help="what to call the head (default: the scan's name)")
    relax = "make the face neutral: auto (where the lips are parted; the default), always or never"
    build.add_argument("--relax", choices=RELAX, default="auto", metavar="WHEN", help=relax)
    leave = "what to leave out as no skin: auto (all of it; the default), never, or of these, with commas between: "
    leave += "depth_jumps, flat_ends, held_by_lips, hair, glasses"
    build.add_argument("--leave-out", default="auto", metavar="WHAT", help=leave)
    build.add_argument("-o", "--output", required=True, metavar="HEAD.blend")

    landmarks = command("landmarks", "Find the landmarks of a scan.", reading)
    landmarks.add_argument("-o", "--output", required=True, metavar="FILE")

    bake = command("bake", "Simulate poses or a performance into shape keys.", chosen, plain)
    sets = "simulate each pose of a set into a shape key; rig: sliders that play the simulation together, by drivers"
    bake.add_argument("--set", choices=SETS, dest="poses", help=sets)
    bake.add_argument("--performance", metavar="FILE", help="simulate a performance into shape key animation")
    about = "with the performance, let flesh swing, and feel the head's motion and gusts of wind"
    bake.add_argument("--dynamic", action="store_true", help=about)
    about = "the model that acts: " + ", ".join(f"{m.name} ({m.title})" for m in models.MODELS.values())
    about += f" (default: {models.DEFAULT})"
    bake.add_argument("--model", choices=tuple(models.MODELS), default=models.DEFAULT, metavar="NAME", help=about)
    bake.add_argument("-o", "--output", metavar="OUT.blend", help="(default: HEAD.blend itself)")

    render = command("render", "Render a contact sheet or an animation.", chosen)
    about = "an expression of the table (default: smile) by each model side by side (PNG)"
    render.add_argument("--models", nargs="?", const="smile", metavar="EXPRESSION", help=about)
    render.add_argument("--fit", action="store_true", help="the distance from the scan as a heat map (PNG)")
    render.add_argument("-o", "--output", required=True, metavar="SHEET.png|MOVIE.mp4")

    export = command("export", "Write an engine-ready copy: no modifiers, exact names.", chosen)
    export.add_argument("-o", "--output", required=True, metavar="FILE.glb|fbx|usdc|usdz")

    sample = command("sample", "Write the embedded sample subject: scan, landmarks, truth.")
    sample.add_argument("--seed", type=int, default=None, help="another individual")
    sample.add_argument("-o", "--output", required=True, metavar="DIR")
    return program


def _unit(text: str) -> str:
    """What ``--units`` may be."""
    from ..sim.scan.units import told_unit

    try:
        told_unit(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None
    return text


def main(argv: list[str] | None = None) -> int:
    """Run the program with ``argv`` (default: the process's arguments); returns the exit status."""
    program = parser()
    try:
        options = program.parse_args(argv)
    except SystemExit as stop:  # Blender's --command must get a status back, not lose its process
        return stop.code if isinstance(stop.code, int) else 2
    debug = getattr(options, "debug", False)
    try:
        from . import commands

        if options.version:
            commands.version()
        elif options.command is None:
            program.print_help()
        else:
            with _terminable():
                getattr(commands, options.command)(options)
        return 0
    except KeyboardInterrupt:
        return _say("Interrupted: nothing was written.", INTERRUPTED)
    except InputError as error:
        return _say(_one_line(error), 2, debug)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # whoever read stdout has gone
        return 1
    except MemoryError:
        return _say("There is not enough memory for this.", 1, debug)
    except OSError as error:
        return _say(f"{error.filename or 'A file'}: {error.strerror or error}.", 1, debug)
    except Exception as error:  # a user gets a sentence, whatever happens
        what = f"{type(error).__name__}: {_one_line(error)}"
        return _say(f"Something went wrong that should not have ({what}): --debug shows where.", 1, debug)


@contextmanager
def _terminable():
    """Being told to end (SIGTERM, as by ``timeout`` or a shutdown) cleans up as Ctrl-C does."""

    def interrupt(*_):
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread: no signals arrive here
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before if before is not None else signal.SIG_DFL)


def _one_line(error) -> str:
    return " ".join(str(error).split())


def _say(sentence: str, status: int, debug: bool = False) -> int:
    if debug:
        import traceback

        traceback.print_exc()
    print(f"headshop: {sentence}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
