# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON as somebody may have written it: names that are given twice, which Python would take the last of without a word,
and tables that are none."""

import json

from .errors import InputError
from .file_bytes import file_bytes


def once(pairs) -> dict:
    """What ``object_pairs_hook`` of `json.loads` may be. Raises KeyError with a key that an object has twice."""
    out = dict(pairs)
    if len(out) != len(pairs):
        keys = [k for k, _ in pairs]
        raise KeyError(next(k for k in keys if keys.count(k) > 1))
    return out


def read_table(path, *keys: str) -> dict:
    """The JSON object with ``keys``, an object or a list each, that is in a file.

    Raises
    ------
    InputError : it cannot be read, or is no such table.
    """
    data = file_bytes(path)
    try:
        table = json.loads(data)
        good = all(isinstance(table[key], dict | list) for key in keys)
    except (ValueError, KeyError, TypeError, RecursionError):
        good = False
    if not good:
        raise InputError(f"{path} is no table with {' and '.join(map(repr, keys))}: give a JSON file that has them.")
    return table
