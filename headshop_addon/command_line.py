# SPDX-License-Identifier: GPL-3.0-or-later
"""The program ``headshop``: what it understands and how it ends. What the commands do is in `commands`.

Exit status: 0 done, 2 the input is at fault, 1 our own fault, 130 interrupted (as a process of its own it dies by the
signal instead, lest a shell's loop goes on); with anything but 0, one sentence on stderr and no file left behind.
"""

import argparse
import atexit
import os
import shutil
import signal
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

from ..sim.errors import InputError
from .quiet import ENDINGS, patient

INTERRUPTED = 130
RELAX = ("auto", "always", "never")
SETS = ("muscles", "arkit", "expressions", "rig")


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of reciting the usage."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help).\n")


def parser() -> argparse.ArgumentParser:
    """The commands and options of DESIGN section 5."""
    with patient():  # NumPy, struck while it is imported, says that it is broken
        from ..sim.acting import models

    program = _Parser(
        prog="headshop", description="A raw scan of a head goes in, a head that acts comes out.", allow_abbrev=False
    )
    program.add_argument("--version", action="store_true", help="print the versions of Head Shop and Blender")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="on errors, show where in the program they happened")
    common.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    plain = argparse.ArgumentParser(add_help=False)
    plain.add_argument(
        "--export", type=_path, metavar="DIR", help="also write plain files (PLY, JSON, NPZ, PNG; mm) into DIR"
    )
    chosen = argparse.ArgumentParser(add_help=False)
    about = "a file that headshop build or the add-on made"
    chosen.add_argument("head", type=_path, metavar="HEAD.blend", help=about)
    chosen.add_argument("--head", dest="name", metavar="NAME", help="which head, if the file holds several")
    reading = argparse.ArgumentParser(add_help=False)
    reading.add_argument(
        "scan",
        type=_path,
        metavar="SCAN",
        help="PLY, OBJ, STL, glTF, USD, FBX, a range map (ECH, NPZ, JSON), or points (PLY, PCD, XYZ, PTS, CSV)",
    )
    about = "the scan's unit: mm, cm, m, in, or millimetres per unit as a number (default: detected)"
    reading.add_argument("--units", type=_unit, metavar="UNIT", help=about)
    up = "the scan's up axis: X, Y, Z or, written --up=-Z, one upside down (default: detected)"
    reading.add_argument("--up", type=_axis, choices=("X", "Y", "Z", "-X", "-Y", "-Z"), metavar="AXIS", help=up)

    commands = program.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    def command(name, about, *parents):
        return commands.add_parser(name, help=about, description=about, parents=[*parents, common], allow_abbrev=False)

    build = command("build", "Turn a scan into an animatable head.", reading, plain)
    about = "landmark file (default: found automatically)"
    build.add_argument("--landmarks", type=_path, metavar="FILE", help=about)
    sizes = (0, 512, 1024, 2048, 4096)
    about = "pixels along a side of the displacement and normal map, 0 for none (default: 1024)"
    build.add_argument("--detail", type=int, choices=sizes, default=1024, metavar="SIZE", help=about)
    build.add_argument("--name", type=_text, help="what to call the head (default: the scan's name)")
    relax = "make the face neutral: auto (where the lips are parted; the default), always or never"
    build.add_argument("--relax", choices=RELAX, default="auto", metavar="WHEN", help=relax)
    leave = "what to leave out as no skin: auto (all of it; the default), never, or of these, with commas between: "
    leave += "depth_jumps, flat_ends, held_by_lips, hair, glasses, beard, clothing"
    build.add_argument("--leave-out", default="auto", metavar="WHAT", help=leave)
    build.add_argument("-o", "--output", type=_path, required=True, metavar="HEAD.blend")

    landmarks = command("landmarks", "Find the landmarks of a scan.", reading)
    landmarks.add_argument("-o", "--output", type=_path, required=True, metavar="FILE")

    bake = command("bake", "Simulate poses or a performance into shape keys.", chosen, plain)
    sets = "simulate each pose of a set into a shape key; rig: sliders that play the simulation together, by drivers"
    bake.add_argument("--set", choices=SETS, dest="poses", help=sets)
    about = "simulate a performance into shape key animation"
    bake.add_argument("--performance", type=_path, metavar="FILE", help=about)
    about = "with the performance, let flesh swing, and feel the head's motion and gusts of wind"
    bake.add_argument("--dynamic", action="store_true", help=about)
    about = "the model that acts: " + ", ".join(f"{m.name} ({m.title})" for m in models.MODELS.values())
    about += f" (default: {models.DEFAULT})"
    bake.add_argument("--model", choices=tuple(models.MODELS), default=models.DEFAULT, metavar="NAME", help=about)
    bake.add_argument("-o", "--output", type=_path, metavar="OUT.blend", help="(default: HEAD.blend itself)")

    render = command("render", "Render a contact sheet or an animation.", chosen)
    about = "an expression of the table (default: smile) by each model side by side (PNG)"
    render.add_argument("--models", nargs="?", const="smile", metavar="EXPRESSION", help=about)
    render.add_argument("--fit", action="store_true", help="the distance from the scan as a heat map (PNG)")
    render.add_argument("-o", "--output", type=_path, required=True, metavar="SHEET.png|MOVIE.mp4")

    export = command("export", "Write an engine-ready copy: no modifiers, exact names.", chosen)
    export.add_argument("-o", "--output", type=_path, required=True, metavar="FILE.glb|fbx|usdc|usdz")

    sample = command("sample", "Write the embedded sample subject: scan, landmarks, truth.")
    sample.add_argument("--seed", type=_seed, default=None, help="another individual: a whole number from 0 up")
    sample.add_argument("-o", "--output", type=_path, required=True, metavar="DIR")
    return program


def _path(text: str) -> str:
    """What the name of a file or folder may be. An empty one, as a script's unset variable gives, would mean the current
    folder. Where a shell leaves a ~ as it is, as after --export=, it means the home folder all the same."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty: give one")
    return os.path.expanduser(_text(text))


def _text(text: str) -> str:
    """A name that Blender and file formats can hold: bytes that are no UTF-8 come from Python as halves of characters."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise argparse.ArgumentTypeError(f"the name {text!r} is no text in UTF-8: rename it") from None
    return text


def _unit(text: str) -> str:
    """What ``--units`` may be."""
    from ..sim.scan.units import told_unit

    try:
        told_unit(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None
    return text


def _seed(text: str) -> int:
    """What ``--seed`` may be."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is no seed: give a whole number from 0 up")
    return int(text)


def _axis(text: str) -> str:
    """``--up`` as its choices have it, however it is written: z, +Z."""
    return text.strip().upper().removeprefix("+")


def main(argv: list[str] | None = None) -> int:
    """Run the program with ``argv``; returns the exit status. Without ``argv`` the process is the program: its arguments
    are taken, and it dies by the signal that interrupts it."""
    struck: list[int] = []
    if argv is None and os.name == "posix":
        atexit.register(_die_by, struck)
        _open_streams()
    try:
        _print_anything()
        status = _ending(argv, struck)
        _finish_printing()
        return status
    except KeyboardInterrupt:
        struck.append(signal.SIGINT)
        return _say("Interrupted: nothing was written.", INTERRUPTED)


def _ending(argv, struck: list[int]) -> int:
    """The exit status of `main`; KeyboardInterrupt goes on, and the signal behind it is added to ``struck``."""
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
            with _interruptible(struck):
                getattr(commands, options.command)(options)
        return 0
    except InputError as error:
        return _say(_one_line(error), 2, debug)
    except BrokenPipeError:  # whoever read stdout has gone; what was made is there
        return 0
    except MemoryError:
        return _say("There is not enough memory for this.", 1, debug)
    except OSError as error:
        return _say(f"{error.filename or 'A file'}: {error.strerror or error}.", 1, debug)
    except Exception as error:  # a user gets a sentence, whatever happens
        if struck:  # in a library that makes something else of it
            raise KeyboardInterrupt from error
        what = f"{type(error).__name__}: {_one_line(error)}"
        return _say(f"Something went wrong that should not have ({what}): --debug shows where.", 1, debug)


@contextmanager
def _interruptible(struck: list[int]):
    """Being told to end, or the terminal being closed, cleans up as Ctrl-C does; ``struck`` gets the signal."""

    def interrupt(number, _):
        struck.append(number)
        raise KeyboardInterrupt

    before = {}
    try:
        for number in ENDINGS:
            handler = signal.getsignal(number)
            # Blender's own Ctrl-C is left alone, and who runs under nohup does not mind the terminal
            if number == signal.SIGTERM or callable(handler) or (number != signal.SIGINT and handler == signal.SIG_DFL):
                before[number] = signal.signal(number, interrupt)
    except ValueError:  # not the main thread: no signals arrive here
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)


def _die_by(struck: list[int]) -> None:
    """End this process by the first signal that struck it, if one did; Blender has no time then to remove its own folder."""
    for number in struck:
        blenders = Path(getattr(getattr(sys.modules.get("bpy"), "app", None), "tempdir", ""))
        if blenders.name.startswith("blender_"):
            shutil.rmtree(blenders, ignore_errors=True)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)


def _open_streams() -> None:
    """Open what is closed of stdin, stdout and stderr onto nothing: the next file opened would take its number, and
    get what Blender prints."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free: this one
    sys.stdout, sys.stderr = sys.stdout or os.fdopen(1, "w"), sys.stderr or os.fdopen(2, "w")


def _print_anything() -> None:
    """What a terminal's encoding lacks, a name in another script for one, is printed escaped."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _finish_printing() -> None:
    """Empty the buffer of stdout, into nothing if whoever read it has gone."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _one_line(error) -> str:
    return " ".join(str(error).split())


def _say(sentence: str, status: int, debug: bool = False) -> int:
    if debug:
        import traceback

        traceback.print_exc()
    with suppress(OSError):  # nobody reads it
        print(f"headshop: {sentence}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
