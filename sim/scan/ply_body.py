# SPDX-License-Identifier: GPL-3.0-or-later
"""The body of a PLY file: the columns of its elements, whose rows may hold lists of any lengths."""

import numpy as np

from ..errors import InputError
from .ply_header import Element

_LONGEST = 10_000  # values of a list in rows that are read as a table
_BLOCK = 1 << 16  # units that are searched for the starts of rows together


def open_body(data: bytes, start: int, encoding: str, path) -> "BinaryBody | AsciiBody":
    """The body that begins at ``start`` of ``data``, in an ``encoding`` as the header names it.

    Raises
    ------
    InputError : it is text in which something is no number.
    """
    return AsciiBody(data[start:], path) if encoding == "ascii" else BinaryBody(data, start, encoding, path)


class _Body:
    """Elements read one after the other. What a subclass counts in, bytes or numbers, is called units here.

    It has ``at``, where the next element begins, and ``size``, all in units.
    """

    def element(self, element: Element) -> dict:
        """Its columns by name: (count,) values, or the lengths (count,) of lists and all their values in a row.

        Raises
        ------
        InputError : the body ends before the element does.
        """
        if not element.count or not element.properties:
            return {p.name: (np.zeros(0, int), np.zeros(0, int)) if p.count_type else [] for p in element.properties}
        lengths = self._first_lengths(element)
        columns = self._alike(element, lengths)
        return columns if columns is not None else self._ragged(element)

    def _first_lengths(self, element) -> dict[str, int]:
        """List lengths of the first row: nearly every file has the same in all rows."""
        at, lengths = np.array([self.at]), {}
        for p in element.properties:
            at, length = self._past(p, at)
            if at[0] > self.size:
                raise _truncated(self.path)
            if p.count_type:
                lengths[p.name] = int(length[0])
        return lengths

    def _past(self, p, at):
        """Where values of a property that begin at ``at`` (k,) end, and the lengths (k,) of lists there (else 1)."""
        length = np.ones(len(at), dtype=np.int64)
        if p.count_type:
            end = at + self._width(p.count_type)
            there = end <= self.size
            length[:] = self.size  # what is beyond the end stays beyond it
            length[there] = np.clip(np.nan_to_num(self._values(at[there], p.count_type)), 0, self.size)
            at = end
        return at + length * self._width(p.type), length

    def _ragged(self, element) -> dict:
        """The columns of rows of any lengths."""
        at, columns = self._starts(element), {}
        for p in element.properties:
            end, length = self._past(p, at)
            first, width = end - length * self._width(p.type), self._width(p.type)
            if p.count_type:
                step = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
                columns[p.name] = length, self._values(np.repeat(first, length) + step * width, p.type)
            else:
                columns[p.name] = self._typed(self._values(first, p.type), p.type)
            at = end
        self.at = int(at[-1])
        return columns

    def _starts(self, element) -> np.ndarray:
        """(count,) where each row begins, which all the lists before it decide.

        In one block after the other it is worked out where a row would end that began at any unit; the rows are those that
        follow each other from the first on, of which each pass finds twice as many.
        """
        found, left, at = [], element.count, self.at
        while left:
            base, end = at, np.arange(at, min(at + _BLOCK, self.size))
            if not len(end):
                raise _truncated(self.path)
            for p in element.properties:
                end, _ = self._past(p, end)
            beyond = len(end)  # one place more, for all rows that begin after the block
            jump = np.append(np.minimum(end - base, beyond), beyond)
            rows = np.zeros(1, dtype=np.int64)
            while rows[-1] < beyond and len(rows) <= left:
                rows = np.concatenate([rows, jump[rows]])
                jump = jump[jump]
            rows = rows[rows < beyond][:left]
            at = int(end[rows[-1]])
            if at > self.size:
                raise _truncated(self.path)
            found.append(base + rows)
            left -= len(rows)
        return np.concatenate(found)


class BinaryBody(_Body):
    """Units are bytes."""

    def __init__(self, data: bytes, start: int, encoding: str, path):
        self.data, self.at, self.size, self.path = data, start, len(data), path
        self.bytes = np.frombuffer(data, np.uint8)
        self.order = "<" if encoding == "binary_little_endian" else ">"

    def _width(self, type_) -> int:
        return np.dtype(type_).itemsize

    def _values(self, places, type_):
        raw = self.bytes[places[:, None] + np.arange(self._width(type_))]
        return raw.view(self.order + type_).ravel()

    def _typed(self, values, type_):
        return values

    def _alike(self, element, lengths):
        """All rows at once if their lists are equally long, else None."""
        fields = []
        for p in element.properties:
            if p.count_type:
                if lengths[p.name] >= _LONGEST:
                    return None
                fields.append((p.name + " length", self.order + p.count_type))
            shape = (lengths[p.name],) if p.count_type else ()
            fields.append((p.name, self.order + p.type, shape))
        row = np.dtype(fields)
        if self.at + row.itemsize * element.count > self.size:
            if not lengths:
                raise _truncated(self.path)
            return None
        table = np.frombuffer(self.data, row, element.count, self.at)
        if any((table[name + " length"] != length).any() for name, length in lengths.items()):
            return None
        self.at += row.itemsize * element.count
        return {
            p.name: (np.full(element.count, lengths[p.name]), table[p.name].ravel()) if p.count_type else table[p.name]
            for p in element.properties
        }


class AsciiBody(_Body):
    """Units are the numbers of a text."""

    def __init__(self, body: bytes, path):
        self.path, self.at = path, 0
        try:
            self.numbers = np.array(body.split(), dtype=np.float64)
        except ValueError as error:
            raise InputError(
                f"{path} is damaged, there is something that is no number in it: export the scan again."
            ) from error
        self.size = len(self.numbers)

    def _width(self, type_) -> int:
        return 1

    def _values(self, places, type_):
        return self.numbers[places]

    def _typed(self, values, type_):
        """Numbers as the header says that they are; what such a type cannot hold becomes what it can."""
        if type_[0] in "iu":
            held = np.iinfo(type_)
            values = np.clip(np.nan_to_num(values), held.min, held.max)
        with np.errstate(over="ignore"):
            return values.astype(type_)

    def _alike(self, element, lengths):
        """All rows at once if their lists are equally long, else None."""
        widths = [1 + lengths[p.name] if p.count_type else 1 for p in element.properties]
        end = self.at + sum(widths) * element.count
        if end > self.size:
            if not lengths:
                raise _truncated(self.path)
            return None
        table = self.numbers[self.at : end].reshape(element.count, -1)
        columns = {}
        for p, width, after in zip(element.properties, widths, np.cumsum(widths), strict=True):
            first = after - width
            if not p.count_type:
                columns[p.name] = self._typed(table[:, first], p.type)
            elif (table[:, first] == width - 1).all():
                columns[p.name] = np.full(element.count, width - 1), table[:, first + 1 : after].ravel()
            else:
                return None
        self.at = end
        return columns


def _truncated(path) -> InputError:
    return InputError(f"{path} is truncated, its end is missing: copy or export it again.")
