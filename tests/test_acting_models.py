# SPDX-License-Identifier: GPL-3.0-or-later
"""Every model by name: one interface, the neutral face exactly the scan, the same smile up and out."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.headshop_addon.command_line import main
from headshop.sim.acting.models import DEFAULT, MODELS, model_named
from headshop.sim.acting.pose import Pose, control
from headshop.sim.errors import InputError
from headshop.sim.tissue.posing import posed_parts


@pytest.fixture(scope="module", params=MODELS)
def acting(request, reference, reference_model):
    """A model of the table and what it builds of the reference head."""
    found = model_named(request.param)
    return found, reference_model if found.name == DEFAULT else found.build(reference)


def test_unknown_models_are_refused():
    with pytest.raises(InputError, match="no model 'clay'"):
        model_named("clay")


def test_neutral_is_the_head_itself(acting, reference):
    found, model = acting
    asked = control(model, Pose())
    for state in (found.rest_state(model), found.solve(model, asked).state):
        for name, vertices in posed_parts(model, state, asked).items():
            assert np.abs(vertices - reference.parts[name].vertices).max() < 1e-9


def test_a_smile_pulls_the_corners_up_and_out(acting, reference):
    found, model = acting
    solution = found.solve(model, control(model, Pose({"zygomaticus_major_l": 1.0, "zygomaticus_major_r": 1.0})))
    assert {"residual", "volume_drift", "penetration_mm", "peak_mm"} <= solution.diagnostics.keys()
    assert 5 < solution.diagnostics["peak_mm"] < 20
    marks = reference.landmarks
    corner = marks.names.index("ch_l")
    moved = marks.weights[corner] @ (solution.state.skin - reference.skin.vertices)[marks.corners[corner]]
    assert moved[2] > 3 and moved[0] > 0.5


def test_the_jaw_takes_the_chin_along(acting, reference):
    found, model = acting
    asked = control(model, Pose(jaw_open=0.5))
    posed = posed_parts(model, found.solve(model, asked).state, asked)
    marks = reference.landmarks
    for name, low, high in (("pg", -30, -10), ("sn", -2, 2)):
        row = marks.names.index(name)
        moved = marks.weights[row] @ (posed["skin"] - reference.skin.vertices)[marks.corners[row]]
        assert low < moved[2] < high, name


@pytest.mark.parametrize(
    "change",
    [
        {"activations": np.zeros(3)},
        {"activations": np.full(69, np.nan)},
        {"jaw": np.zeros(2)},
        {"lids": [[0, 0], [0, "shut"]]},
        {"cheeks": np.inf},
    ],
)
def test_a_control_that_does_not_fit_is_refused(acting, change):
    """Some of it was taken for no contraction at all."""
    found, model = acting
    with pytest.raises(InputError, match=next(iter(change))):
        found.solve(model, replace(control(model, Pose()), **change), max_iterations=2)


def test_what_is_no_control_no_pose_or_no_tolerance_is_refused(acting):
    """They were errors of Python's, or tolerances at which nothing ever comes to rest."""
    found, model = acting
    with pytest.raises(InputError, match="given as Pose: give a Control"):
        found.solve(model, Pose())
    with pytest.raises(InputError, match="given as dict: give a Pose"):
        control(model, {"jaw_open": 1.0})
    if found.name == "waters":
        return  # it does not iterate
    for none in (0, -1.0, np.nan, np.inf, "tight"):
        with pytest.raises(InputError, match="tolerance"):
            found.solve(model, control(model, Pose()), tolerance=none)


@pytest.mark.parametrize("model", MODELS)
def test_a_head_that_is_none_is_refused(model, reference):
    """In metres it became a model that did not move."""
    with pytest.raises(InputError, match="given as NoneType: give a Head"):
        model_named(model).build(None)
    small = reference.with_vertices({part: points / 1000 for part, points in reference.vertices().items()})
    with pytest.raises(InputError, match="millimetres"):
        model_named(model).build(small)
    torn = reference.skin.vertices.copy()
    torn[0] = np.nan
    with pytest.raises(InputError, match="skin has vertices"):
        model_named(model).build(reference.with_vertices({"skin": torn}))


def test_the_command_line_names_the_models(tmp_path, capsys):
    head = tmp_path / "head.blend"
    head.write_bytes(b"x")
    assert main(["bake", str(head), "--set", "muscles", "--model", "clay"]) == 2
    said = capsys.readouterr().err
    assert all(name in said for name in ("--model", *MODELS))
    assert main(["render", str(head), "--models", "--fit", "-o", str(tmp_path / "x.png")]) == 2
    assert main(["render", str(head), "--models", "-o", str(tmp_path / "x.mp4")]) == 2
    assert ".png" in capsys.readouterr().err


def test_a_sheet_shows_one_expression_by_each_model(bpy, reference, reference_model, tmp_path, monkeypatch):
    from headshop.headshop_addon import heads, model_sheet
    from headshop.headshop_addon.pictures import read_picture
    from headshop.sim.progress import finish

    monkeypatch.setattr("headshop.sim.tissue.model.build_model", lambda head: reference_model)
    quick = {name: MODELS[name] for name in ("headshop", "waters")}
    monkeypatch.setattr(model_sheet, "MODELS", quick)
    monkeypatch.setattr(model_sheet, "WIDTH", 60)
    monkeypatch.setattr(model_sheet, "HEIGHT", 72)
    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    with pytest.raises(InputError, match="no expression 'grin'"):
        finish(model_sheet.render_models(skin, tmp_path / "sheet.png", "grin"))
    finish(model_sheet.render_models(skin, tmp_path / "sheet.png", "joy", samples=1))
    page = read_picture(tmp_path / "sheet.png")[..., :3]
    assert page.shape[1] > 3 * 60 and page.shape[0] > 3 * 72
    assert skin.data.shape_keys is None, "the head itself is left alone"
