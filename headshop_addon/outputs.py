# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that appear whole or not at all: written under temporary names, renamed together when everything is done."""

import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

from ..sim.errors import InputError


class Outputs:
    """Use as ``with Outputs() as outputs``; leaving it by any exception, Ctrl-C included, removes what was begun.

    Folders that had to be made for an output go too if it does not come about. ``inputs`` are files that no output may
    replace or remove.
    """

    def __init__(self, inputs=()):
        self._inputs = [Path(path).resolve() for path in inputs if path is not None]
        self._renames: list[tuple[Path, Path]] = []
        self._folders: list[tuple[Path, Path]] = []
        self._scratch: list[Path] = []
        self._made: list[Path] = []

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        try:
            if isinstance(error, InputError):
                self._name_outputs(error)
            if kind is None:
                for temporary, final in self._folders:
                    with _told(final):
                        self._fill(temporary, final)
                for temporary, final in self._renames:
                    with _told(final):
                        if temporary.exists():
                            os.replace(temporary, final)
                        else:
                            final.unlink(missing_ok=True)
                self._made.clear()
        finally:
            for scratch in self._scratch:
                shutil.rmtree(scratch, ignore_errors=True)
            for folder in reversed(self._made):
                try:
                    folder.rmdir()
                except OSError:
                    pass  # somebody else put something there meanwhile
        return False

    def file(self, path, beside: str | None = None) -> Path:
        """A path to write to instead of ``path``, which it becomes in the end: same name, in a hidden folder beside it. Where
        ``path`` is a link, what it leads to is written, unless there is a folder ``beside``, to which it must lie near.

        ``beside`` is the name of a folder that may be made next to it. What is in it goes into the folder of that name
        next to ``path``, before ``path`` appears, and replaces files of the same names; others there stay.

        Raises
        ------
        InputError : nothing can be written there, it is a folder, or an input.
        """
        with _told(path):
            return self._file(Path(path), beside)

    def _file(self, path: Path, beside: str | None) -> Path:
        if path.is_dir():
            raise InputError(f"{path} is a folder: give the name of a file to write.")
        self._spare_inputs(path)
        final = Path(os.path.realpath(path)) if beside is None and path.is_symlink() else path
        scratch = self._scratch_beside(final)
        if path.exists() and not os.access(path, os.W_OK):
            raise InputError(f"{path} is write-protected: give another output.")
        if beside is not None:
            folder = path.parent / beside
            if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK)):
                raise InputError(
                    f"{folder} must be a folder that can be written to, for {path.name}: rename the output."
                )
            self._folders.append((scratch / beside, folder))
        self._renames.append((scratch / path.name, final))
        return scratch / path.name

    def folder(self, path, names) -> Path:
        """A folder to write files into instead of ``path``, to which they move in the end.

        ``names`` are all that can be written: of those, what is not written this time is removed from ``path``, so
        that no file of an earlier run stands among the new ones.

        Raises
        ------
        InputError : nothing can be written there, it is or becomes a file, or one of ``names`` there is an input.
        """
        with _told(path):
            return self._folder(Path(path), names)

    def _folder(self, path: Path, names) -> Path:
        becoming = [final.resolve() for _, final in self._renames]
        if (path.exists() and not path.is_dir()) or path.resolve() in becoming:
            raise InputError(f"{path} is a file: give a folder to write to.")
        for name in names:
            self._spare_inputs(path / name)
        scratch = self._scratch_beside(path / "any")
        self._renames += [(scratch / name, path / name) for name in names]
        return scratch

    def _name_outputs(self, error: InputError) -> None:
        """Raise ``error`` again if it speaks of a temporary file, with the name that the user gave instead."""
        said = str(error)
        for temporary, final in (*self._renames, *self._folders):
            said = said.replace(str(temporary), str(final))
        if said != str(error):
            raise InputError(said) from error

    def _spare_inputs(self, path: Path) -> None:
        if Path(os.path.realpath(path)) in self._inputs:  # `resolve` stumbles over a link to itself
            raise InputError(f"{path} would be replaced, which is an input: write to another place.")

    def _scratch_beside(self, path: Path) -> Path:
        folder = path.parent
        try:
            self._make(folder)
            scratch = Path(tempfile.mkdtemp(prefix=".headshop-", dir=folder))
        except OSError as error:
            why = error.strerror or error
            raise InputError(f"Nothing can be written to {folder} ({why}): give another output.") from None
        self._scratch.append(scratch)
        return scratch

    def _fill(self, temporary: Path, final: Path):
        files = sorted(temporary.iterdir()) if temporary.is_dir() else []
        if files:
            self._make(final)
        for file in files:
            os.replace(file, final / file.name)

    def _make(self, folder: Path):
        missing = []
        while not folder.exists():
            missing.append(folder)
            folder = folder.parent
        for each in reversed(missing):
            try:
                each.mkdir()
            except FileExistsError:
                continue  # by now: another run made it, or it is what a folder that was missing lies in, a/..
            self._made.append(each)


@contextmanager
def _told(path):
    """`InputError` instead of an error of the file system about ``path``."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}): give another output.") from error
