# SPDX-License-Identifier: GPL-3.0-or-later
"""What each command of the command line does. Inputs and outputs are checked before Blender is started.

Every function takes the parsed options; `InputError` means that the user is told and nothing was written.
"""

import os
import stat
from pathlib import Path

from ..sim.errors import InputError
from ..sim.progress import finish
from .engine_files import KINDS, textures_folder
from .headless import open_head, save, set_up_view, start_blender, wake_cycles
from .outputs import Outputs
from .progress_bar import progress_bar

#: File extensions each command writes.
_BLEND, _PICTURES, _LANDMARKS = (".blend",), (".png", ".mp4"), (".json",)


def version() -> None:
    """Print the versions of what a head is made with."""
    start_blender()
    from .provenance import versions

    print("  ".join(f"{name} {number}" for name, number in versions().items()))


def build(options) -> None:
    """A scan, and landmarks if there are, to a head in a .blend, with plain files if asked for."""
    from ..sim.adapt.landmarks import read_landmark_file
    from ..sim.adapt.scan_surface import to_leave_out

    _require_file(options.scan, "scan")
    _require_kind(options.output, _BLEND)
    to_leave_out(options.leave_out)
    landmarks = None if options.landmarks is None else read_landmark_file(options.landmarks)
    with Outputs((options.scan, options.landmarks)) as outputs:
        blend = outputs.file(options.output)
        plain = _plain_folder(outputs, options)
        start_blender()
        from . import pipeline

        name = options.name or Path(options.scan).stem
        wanted = {"detail": options.detail, "relax": options.relax, "leave_out": options.leave_out}
        if landmarks is None:
            work = pipeline.build_alone(options.scan, name, options.units, options.up, **wanted)
        else:
            wanted["found"] = landmarks.found
            work = pipeline.build_file(options.scan, landmarks.positions, name, options.units, options.up, **wanted)
        skin, report = _run(work, options)
        set_up_view(skin)
        save(blend)
        _write_plain(skin, plain, outputs)
    if not options.quiet:
        print(f"{options.output}: {report['fit']['sentence']}")
        _say_if_unsure(report["scan"])
        if report["fit"]["advice"]:
            print(report["fit"]["advice"])


def landmarks(options) -> None:
    """Automatic landmarks to a file, in mm along the scan file's own axes."""
    from ..sim.adapt.landmarks import write_landmarks

    _require_file(options.scan, "scan")
    _require_kind(options.output, _LANDMARKS)
    with Outputs((options.scan,)) as outputs:
        file = outputs.file(options.output)
        start_blender()
        from . import pipeline

        scan, found = _run(pipeline.load_scan_alone(options.scan, options.units, options.up), options)
        back = {name: position @ scan.orientation.rotation for name, position in found.positions.items()}
        write_landmarks(file, back, found.missing, found.confidence, found.mid_air)
    if not options.quiet:
        print(f"{options.output}: {found.summary()}")
        if found.doubt:
            print(found.doubt)
        _say_if_unsure(scan.report)


def _say_if_unsure(scan: dict) -> None:
    """Tell whoever knows better that unit or axes of the ``scan``, a report's block, are doubtful, or a mere guess."""
    from ..sim.scan.units import BY_FACE

    if scan["unit"] == BY_FACE:
        print(f"{scan['orientation']} If you know how long a unit is, give it: --units MILLIMETRES.")
    elif not scan["certain"]:
        print(scan["orientation"])


def bake(options) -> None:
    """Poses or a performance to shape keys."""
    _require_head_file(options.head)
    if options.poses is None and options.performance is None:
        raise InputError(
            "There is nothing to bake: give --set muscles, --set expressions, --set arkit, --set rig or --performance FILE."
        )
    if options.dynamic and options.performance is None:
        raise InputError("Only a performance moves in time: give --performance FILE, or leave out --dynamic.")
    output = options.output or options.head
    _require_kind(output, _BLEND)
    performance = None
    if options.performance is not None:
        from ..sim.acting.performance import read_performance

        performance = read_performance(options.performance)
    with Outputs((options.performance,)) as outputs:
        blend = outputs.file(output)
        plain = _plain_folder(outputs, options)
        skin = open_head(options.head, options.name)
        from . import baking

        made = _run(baking.bake(skin, options.poses, performance, options.model, options.dynamic), options)
        save(blend)
        _write_plain(skin, plain, outputs)
    if not options.quiet:
        print(f"{output}: {baking.summary(made)}")


def render(options) -> None:
    """A contact sheet or a movie."""
    _require_head_file(options.head)
    if options.fit and options.models is not None:
        raise InputError("A sheet shows either the fit or the models: give --fit or --models.")
    still = options.fit or options.models is not None
    kind = _require_kind(options.output, _PICTURES[:1] if still else _PICTURES)
    with Outputs() as outputs:
        picture = outputs.file(options.output)
        skin = open_head(options.head, options.name)
        wanted = {}
        if options.fit:
            from .heat_sheet import render_fit as render_it
        elif options.models is not None:
            from .model_sheet import render_models as render_it

            wanted = {"expression": options.models}
        elif kind == ".png":
            from .contact_sheet import render_sheet as render_it
        else:
            from .movie import render_movie as render_it
        if not options.fit:
            wake_cycles()
        _run(render_it(skin, picture, **wanted), options)
    if not options.quiet:
        print(options.output)


def export(options) -> None:
    """An engine-ready copy."""
    _require_head_file(options.head)
    _require_kind(options.output, KINDS)
    with Outputs() as outputs:
        copy = outputs.file(options.output, textures_folder(options.output))
        skin = open_head(options.head, options.name)
        from .export import export_head

        names = export_head(skin, copy)
    if not options.quiet:
        print(f"{options.output}: {len(names)} shape{'s' * (len(names) != 1)}")


def sample(options) -> None:
    """The embedded sample subject as plain files; needs no Blender."""
    from ..sim.scan.sample import SEED, make_sample, write_sample

    files = ("scan.ply", "landmarks.json", "truth.ply")
    with Outputs() as outputs:
        folder = outputs.folder(options.output, files)
        write_sample(_run(make_sample(SEED if options.seed is None else options.seed), options), folder)
    if not options.quiet:
        print(f"{options.output}: {', '.join(files)}")


def _require_file(path, what: str) -> None:
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"The {what} {path} is not there: check the name.") from None
    except OSError as error:
        raise InputError(
            f"The {what} {path} cannot be read ({error.strerror}): check the name and your rights."
        ) from None
    if stat.S_ISDIR(mode):
        raise InputError(f"The {what} {path} is a folder: check the name.")
    if not stat.S_ISREG(mode):
        raise InputError(
            f"The {what} {path} is a pipe or a device, which can be read only once: save it to a file first."
        )
    if not os.access(path, os.R_OK):
        raise InputError(f"The {what} {path} cannot be read (Permission denied): check the name and your rights.")


def _require_head_file(path) -> None:
    _require_file(path, "head")
    if Path(path).stat().st_size == 0:
        raise InputError(f"{path} is empty (0 bytes): build the head again.")


def _require_kind(path, kinds) -> str:
    kind = Path(path).suffix.lower()
    if kind not in kinds:
        raise InputError(f"The output {path} must end in {' or '.join(kinds)}: rename it.")
    return kind


def _run(work, options):
    with progress_bar(not options.quiet) as show:
        return finish(work, show)


def _plain_folder(outputs: Outputs, options):
    if options.export is None:
        return None
    from .plain_files import FILES

    return outputs.folder(options.export, FILES)


def _write_plain(skin, folder, outputs: Outputs) -> None:
    if folder is not None:
        from .plain_export import write_plain

        write_plain(skin, folder)
