#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A tour with mouse and keyboard, as an artist goes: sample, landmarks found and clicked, head, slider, expression, bake.

Started by blender-gui once Blender's window is up. Each step asserts; pictures land in ``$HEADSHOP_GUI``.
"""

import math
import sys
import time

sys.path.insert(0, __file__.rpartition("/")[0])
from window import ask, choose_tab, click, drag, find, key, point, press, scroll_up, shot, wait_for

SCAN = "bpy.context.scene.headshop.scan"
ORDER = ["prn", "ex_r", "ex_l", "ch_r"]
TRUTH = {}  # landmark -> world position, of the sample


def say(text):
    """A line for the log."""
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


def distance(a, b):
    """Millimetres between two points in metres."""
    return math.dist(a, b) * 1000


def add_sample():
    """The sample arrives under a progress bar, with landmarks, and the view looks at it."""
    press("make_sample", across=0.25)
    wait_for("job()")
    shot("02_progress")
    wait_for(f"{SCAN} is not None and not job()")
    assert len(ask("landmarks('PLACED')")) == 60
    shot("03_sample")

    TRUTH.update(ask("landmarks('PLACED')"))


def find_landmarks():
    """Esc in the middle finds nothing; then all are found, in one step for undo; one is corrected and its like follow."""
    press("clear_landmarks", across=0.75)
    assert not ask("landmarks('PLACED', 'DERIVED')")
    before = ask("counts()")
    press("find_landmarks")
    wait_for("job()", 20)
    shot("04_finding")
    key("Escape")
    wait_for("not job()", 20)
    assert not ask("landmarks('PLACED', 'FOUND', 'DERIVED')") and ask("counts()") == before
    press("find_landmarks")
    wait_for("landmarks('FOUND') and not job()", 300)
    found = ask("landmarks('FOUND')")
    off = [distance(found[name], TRUTH[name]) for name in found]
    say(f"{len(off)} found, {sum(off) / len(off):.1f} mm from the truth on average")
    assert len(off) == 60 and sum(off) / len(off) < 6.0, off
    point(600, 850)
    key("ctrl+z")
    wait_for("not landmarks('FOUND')", 20)
    key("ctrl+shift+z")
    wait_for("len(landmarks('FOUND')) == 60", 20)
    shot("05_found")
    wrong = ask("to_correct()")
    press("click_landmarks(start=")
    wait_for(f"asked() == {wrong!r}", 10)
    x, y = ask(f"on_screen([{found[wrong]}])")[0]
    click(x, y - 12)
    wait_for("len(landmarks('PLACED')) == 1 and not asked()", 20)
    after = ask("landmarks('FOUND', 'PLACED')")
    moved = sorted((distance(after[name], found[name]), name) for name in found)
    assert moved[-1][1] == wrong and moved[-2][0] > 0.5 and moved[0][0] < 0.1 * moved[-1][0], moved
    assert ask("to_correct()") not in ("", wrong)
    shot("06_corrected")


def click_landmarks():
    """Five clicks on the surface; one is taken back, one skipped; Esc keeps; undo and redo work on the whole."""
    truth = TRUTH
    press("clear_landmarks", across=0.75)
    assert not ask("landmarks('PLACED', 'DERIVED')")
    press("click_landmarks")
    for count, name in enumerate(ORDER, 1):
        wait_for(f"asked() == {name!r}", 10)
        click(*ask(f"on_screen([{truth[name]}])")[0])
        placed = wait_for(f"len(landmarks('PLACED')) == {count} and landmarks('PLACED')", 20)
        assert distance(placed[name], truth[name]) < 3.0, (name, placed[name], truth[name])
        assert len(ask("landmarks('DERIVED')")) == (57 if count == 3 else 56 if count == 4 else 0)
        if count == 2:
            shot("07_two_clicks")
    shot("08_four_clicks")
    key("ctrl+z")
    assert sorted(ask("landmarks('PLACED')")) == sorted(ORDER[:3]) and ask("asked()") == ORDER[3]
    click(*ask(f"on_screen([{truth[ORDER[3]]}])")[0])
    wait_for("len(landmarks('PLACED')) == 4", 20)
    skipped = ask("asked()")
    key("n")
    assert ask("asked()") not in ("", skipped)
    for name in ("gn", "n"):
        while ask("asked()") != name and ask("asked()"):
            key("n")
        if ask("asked()"):
            click(*ask(f"on_screen([{truth[name]}])")[0])
    count = len(ask("landmarks('PLACED')"))
    assert count >= 4
    key("Escape")
    assert ask("asked()") == "" and len(ask("landmarks('PLACED')")) == count
    shot("09_landmarks_kept")
    key("ctrl+z")
    wait_for("not landmarks('PLACED')", 10)
    key("ctrl+shift+z")
    wait_for(f"len(landmarks('PLACED')) == {count}", 10)
    say(f"{count} landmarks placed by clicks")


def build():
    """Esc in the middle leaves nothing; the second time the head is built, in one step for undo and redo."""
    before = ask("counts()")
    scroll_up()
    press("build_head")
    wait_for("job()", 20)
    key("Escape")
    wait_for("not job()", 20)
    assert ask("counts()") == before and ask("skin()") is None
    press("build_head")
    wait_for("job()", 20)
    shot("10_building")
    start = time.monotonic()
    wait_for("skin() is not None and not job()", 400)
    say(f"built in {time.monotonic() - start:.1f} s")
    after = ask("counts()")
    point(600, 850)
    key("ctrl+z")
    wait_for("skin() is None", 20)
    assert ask("counts()") == before
    key("ctrl+shift+z")
    wait_for("skin() is not None", 20)
    assert ask("counts()") == after
    shot("11_built")


def show_fit():
    """The heat map takes the place of the skin's materials, and they come back."""
    before = ask("skin_look()")
    x, y = find("headshop.show_fit", keys="ctrl+shift+c")
    click(x, y)
    wait_for("set(skin_look()) == {'Head Shop Fit', 'VERTEX'}", 30)
    shot("12_fit")
    click(x, y)
    wait_for(f"skin_look() == {before!r}", 30)


def degrade():
    """Without xatlas only repacking is grey, and its tooltip says why."""
    if ask("__import__('importlib.util').util.find_spec('xatlas') is None"):
        assert not ask("bpy.ops.headshop.repack_uv.poll()") and ask("bpy.ops.headshop.bake_expressions.poll()")
        x, y = find("bpy.ops.headshop.dress_head(")
        point(x, y + 20)
        time.sleep(2.0)
        shot("13_repack_tooltip")


def act():
    """A slider is dragged and the face follows; undo takes both back; an expression is set."""
    x, y = find("headshop.controls.jaw_open", keys="ctrl+shift+c")
    drag(x - 60, y, 90)
    value = ask("skin().headshop.controls.jaw_open")
    assert value > 0.1, value
    wait_for("moved() > 2.0", 60)
    wait_for("settled()", 120)
    say(f"jaw_open {value:.2f} moves the skin by {ask('moved()'):.1f} mm")
    shot("14_jaw_open")
    key("ctrl+z")
    wait_for("skin().headshop.controls.jaw_open == 0.0 and moved() < 0.01", 30)
    press('set_expression(expression="joy"', across=0.25)
    wait_for("moved() > 2.0", 60)
    wait_for("settled()", 120)
    shot("15_joy")


def prepare():
    """The instant preview offers to be prepared, and Esc leaves the head without one."""
    scroll_up()
    x, y = find("headshop.model", keys="ctrl+shift+c", across=0.5)
    click(x, y)
    wait_for("skin().headshop.model == 'INSTANT'", 10)
    shot("16_instant")
    press("prepare_response")
    wait_for("job().count('Simulating')", 60)
    shot("17_preparing")
    key("Escape")
    wait_for("not job()", 60)
    assert not ask("prepared()")
    click(*find("headshop.model", keys="ctrl+shift+c", across=0.2))
    wait_for("skin().headshop.model == 'SIMULATED'", 10)


def animate():
    """Sliders keyed at two frames are baked with dynamics; one button takes the animation off again."""
    keys = ask("[k.name for k in skin().data.shape_keys.key_blocks]")
    ask("setattr(bpy.context.scene, 'frame_end', 4)")
    scroll_up()
    press("key_sliders", across=0.25)
    ask("bpy.context.scene.frame_set(4)")
    press("reset_muscles", across=0.75)
    press("key_sliders", across=0.25)
    click(*find("headshop.dynamics", keys="ctrl+shift+c"))
    wait_for("skin().headshop.dynamics", 10)
    shot("19_dynamics")
    press("bake_performance")
    wait_for("job()", 20)
    wait_for("not job()", 300)
    assert ask("moved('Performance_01')") > 1.0 and not ask("skin().headshop.live")
    ask("bpy.context.scene.frame_set(2)")
    shot("20_animation")
    press("remove_baked", across=0.6)
    wait_for("skin().headshop.live", 20)
    assert set(ask("[k.name for k in skin().data.shape_keys.key_blocks]")) <= set(keys)
    shot("21_removed")
    ask("bpy.context.scene.frame_set(1)")


def bake():
    """Baking shows progress, and Esc leaves no shape key behind."""
    ask("bpy.ops.ed.undo_push(message='Tour')")
    keys = ask("[k.name for k in skin().data.shape_keys.key_blocks]")
    press("bake_expressions")
    wait_for("job().count('Simulating')", 60)
    shot("18_baking")
    key("Escape")
    wait_for("not job()", 60)
    assert ask("[k.name for k in skin().data.shape_keys.key_blocks]") == keys


def disable():
    """Switched off, nothing of ours is left in the window."""
    ask("bpy.ops.preferences.addon_disable(module='bl_ext.user_default.headshop')")
    assert ask("[name for name in dir(bpy.types) if 'HEADSHOP' in name]") == []
    assert not ask("hasattr(bpy.types.Object, 'headshop')")
    shot("22_disabled")


def main():
    """The whole tour."""
    choose_tab()
    shot("01_start")
    for step in (
        add_sample,
        find_landmarks,
        click_landmarks,
        build,
        show_fit,
        degrade,
        act,
        prepare,
        bake,
        animate,
        disable,
    ):
        say(step.__doc__)
        step()
    say("done")


if __name__ == "__main__":
    try:
        main()
    except BaseException:
        shot("failed")
        raise
