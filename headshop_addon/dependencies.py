# SPDX-License-Identifier: GPL-3.0-or-later
"""Which libraries this Blender has, and what to tell the artist about one it has not.

The zips for Blender's own builds bundle scipy, threadpoolctl and xatlas; the zip without wheels relies on the system's Python.
"""

from functools import cache
from importlib import metadata, util

#: Library -> what it is for.
NEEDED_FOR = {
    "scipy": "fitting and simulating heads",
    "threadpoolctl": "fast fits while other work runs",
    "xatlas": "repacking UVs",
}


@cache
def available(name: str) -> bool:
    """Whether ``name`` can be imported."""
    return util.find_spec(name) is not None


def version(name: str) -> str:
    """The installed version, or an empty string."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def reason(name: str) -> str:
    """One sentence for a tooltip: what is missing and what to do; empty when nothing is."""
    if available(name):
        return ""
    return (
        f"The Python library {name}, needed for {NEEDED_FOR[name]}, is not in this Blender: "
        "install the Head Shop zip made for your platform, or add it to the system's Python"
    )
