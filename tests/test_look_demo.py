# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo's manners; what it makes is tested piece by piece elsewhere."""

import pytest


def test_a_folder_that_cannot_be_made_is_said_at_once(tmp_path, capsys):
    pytest.importorskip("bpy")
    from headshop.headshop_addon import demo

    (tmp_path / "taken").write_text("a file")
    assert demo.main(["-o", str(tmp_path / "taken")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("demo: ") and "choose another folder" in said and said.count("\n") == 1
    assert (tmp_path / "taken").read_text() == "a file"


def test_the_demos_sheet_shows_the_six_basic_expressions(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon import demo
    from headshop.sim.acting.expressions import expressions

    basic = {"joy", "sadness", "anger", "fear", "disgust", "surprise"}
    assert basic <= set(demo.SHEET["keys"]) <= set(expressions())
