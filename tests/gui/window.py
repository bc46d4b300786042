# SPDX-License-Identifier: GPL-3.0-or-later
"""The driver's hands and eyes: mouse and keyboard through xdotool, questions to Blender, pictures of the screen."""

import json
import os
import subprocess
import time
from pathlib import Path

FOLDER = Path(os.environ["HEADSHOP_GUI"])


def ask(expression: str, timeout: float = 180.0):
    """The value of a Python expression inside Blender (see session.py)."""
    (FOLDER / "answer").unlink(missing_ok=True)
    (FOLDER / "question.part").write_text(expression)
    (FOLDER / "question.part").rename(FOLDER / "question")
    until = time.monotonic() + timeout
    while not (FOLDER / "answer").exists():
        if time.monotonic() > until:
            raise TimeoutError(f"Blender did not answer: {expression}")
        time.sleep(0.02)
    answer = json.loads((FOLDER / "answer").read_text())
    if "error" in answer:
        raise RuntimeError(f"{expression}\n{answer['error']}")
    return answer["value"]


def wait_for(expression: str, timeout: float = 180.0):
    """Ask until the answer is true; returns it."""
    until = time.monotonic() + timeout
    while not (value := ask(expression)):
        if time.monotonic() > until:
            shot("timeout")
            raise TimeoutError(f"never became true: {expression}")
        time.sleep(0.2)
    return value


def xdo(*arguments) -> None:
    """One xdotool call."""
    subprocess.run(["xdotool", *map(str, arguments)], check=True, capture_output=True, text=True)


def point(x, y):
    """Move the mouse, in two steps so that Blender notices."""
    xdo("mousemove", int(x) - 2, int(y), "sleep", 0.05, "mousemove", int(x), int(y), "sleep", 0.1)


def click(x, y, button=1):
    """Click as a hand does: press and release some frames apart."""
    point(x, y)
    xdo("mousedown", button, "sleep", 0.1, "mouseup", button)
    time.sleep(0.3)


def drag(x, y, dx):
    """Drag sideways with the left button."""
    point(x, y)
    xdo("mousedown", 1)
    for step in range(1, 9):
        xdo("mousemove", int(x + dx * step / 8), int(y), "sleep", 0.15)
    xdo("mouseup", 1)
    time.sleep(0.5)


def key(name):
    """Press a key, and give Blender time to see it."""
    xdo("key", "--clearmodifiers", name)
    time.sleep(0.3)
    ask("None")


def shot(name):
    """A picture of the whole screen."""
    time.sleep(0.7)
    ask("None")
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)


def choose_tab(name="Head Shop"):
    """Click down the sidebar's edge until the tab is chosen."""
    ask("open_sidebar()")
    time.sleep(0.5)
    left, top, width, height = ask("box('UI')")
    for y in range(top + 20, top + height, 30):
        click(left + width - 8, y)
        if ask("tab()") == name:
            return
    raise AssertionError(f"the sidebar has no tab {name}")


def find(wanted: str, keys="ctrl+c", across=0.4, scroll=True) -> tuple[int, int]:
    """Screen position of the sidebar's button that calls ``wanted``, or of the property with this data path.

    Hovers down the sidebar: Ctrl-C over a button copies its Python call, Ctrl-Shift-C over a property its path.
    """
    left, top, width, height = ask("box('UI')")
    x = left + int(width * across)
    for _ in range(6 if scroll else 1):
        for y in range(top + 24, top + height - 6, 14):
            point(x, y)
            xdo("key", "--clearmodifiers", keys, "sleep", 0.05)
            if wanted in ask("take_clipboard()"):
                return x, y
        point(x, top + height // 2)
        xdo("click", "--repeat", 12, "--delay", 30, 5)
        time.sleep(0.5)
    shot("not_found")
    raise AssertionError(f"no button or property {wanted} in the sidebar")


def scroll_up():
    """Back to the top of the sidebar."""
    left, top, width, height = ask("box('UI')")
    point(left + width * 0.4, top + height // 2)
    xdo("click", "--repeat", 80, "--delay", 10, 4)
    time.sleep(0.5)


def press(operator: str, across=0.4):
    """Find the button that calls an operator (its name, or the beginning of its call) and click it."""
    click(*find(f"bpy.ops.headshop.{operator}", across=across))
