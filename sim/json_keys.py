# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in somebody's JSON that are given twice: Python would take the last without a word."""


def once(pairs) -> dict:
    """What ``object_pairs_hook`` of `json.loads` may be. Raises KeyError with a key that an object has twice."""
    out = dict(pairs)
    if len(out) != len(pairs):
        keys = [k for k, _ in pairs]
        raise KeyError(next(k for k in keys if keys.count(k) > 1))
    return out
