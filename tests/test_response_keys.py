# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig as shape keys: formulas that a driver can say, and a file that plays the simulation without the extension."""

import json
import subprocess
import sys

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control, pose_from
from headshop.sim.errors import InputError
from headshop.sim.progress import finish
from headshop.sim.response import fit, formula, keys, mixtures, playing, quantities, sampling, storage
from headshop.sim.response.actor import actor_of
from headshop.sim.response.formula import of
from headshop.sim.response.jaw_frame import JawFrame
from headshop.sim.tissue.solver import solve

ZYGOMATICUS, LEVATOR = "zygomaticus_major_l", "levator_labii_superioris_l"

_PLAY = """
import json, sys
import bpy
import numpy as np
path, poses, out = sys.argv[1:]
bpy.context.preferences.filepaths.use_scripts_auto_execute = False
bpy.ops.wm.open_mainfile(filepath=path, use_scripts=False)
assert "headshop" not in sys.modules
found, simple = {}, True
for obj in bpy.data.objects:
    if obj.type == "MESH" and obj.data.shape_keys is not None:
        obj.modifiers.clear()
        data = obj.data.shape_keys.animation_data
        for curve in data.drivers if data else ():
            simple = simple and (curve.driver.type != "SCRIPTED" or curve.driver.is_simple_expression)
blocks = bpy.data.objects["Fran Skin"].data.shape_keys.key_blocks
for number, pose in enumerate(json.loads(poses)):
    for block in blocks:
        if not block.name.startswith("~") and block.name != "Basis":
            block.value = pose.get(block.name, 0.0)
    bpy.context.view_layer.update()
    for part in ("Skin", "Mandible"):
        mesh = bpy.data.objects["Fran " + part].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        at = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", at)
        found[f"{part}{number}"] = at.reshape(-1, 3) * 1000
np.savez(out, simple=simple, **found)
"""


def test_what_a_driver_is_told_is_what_numpy_works_out():
    x, y = of("x"), of("y")
    known = {"x": np.array([0.2, 0.9, -0.4]), "y": np.array([1.0, -2.0, 0.5])}
    letters = {"x": "a", "y": "b"}
    for made, text, value in (
        (x * y, "a*b", known["x"] * known["y"]),
        (x * (1 - y), "a*(1-b)", known["x"] * (1 - known["y"])),
        (x / (y * y), "a/(b*b)", known["x"] / known["y"] ** 2),
        (x * -1.0, "-a", -known["x"]),
        (formula.clipped(x - y * 0.5, 0, 1), "min(max(a-b*0.5,0),1)", np.clip(known["x"] - known["y"] / 2, 0, 1)),
        (formula.tent(x, 0.1, 0.5, 1), "max(min((a-0.1)*2.5,(1-a)*2),0)", [0.25, 0.2, 0]),
        (formula.weighted({"x": 0.25, "y": -1.5}), "a*0.25+b*(-1.5)", known["x"] / 4 - 1.5 * known["y"]),
    ):
        np.testing.assert_allclose(made.value(known), value, atol=1e-12)
        assert made.text(letters) == text


@pytest.fixture(scope="module")
def learnt(reference, reference_model):
    """A rig of two muscles and the jaw, learnt from a few poses: enough to smile with an open mouth."""
    alone = [{ZYGOMATICUS: 1.0}, {LEVATOR: 1.0}, {"jaw_open": 1.0}]
    way = [{name: value} for name in (ZYGOMATICUS, LEVATOR) for value in (0.3, 0.65)]
    way += [{"jaw_open": value} for value in (0.2, 0.4, 0.7)]
    pairs = [{ZYGOMATICUS: 1.0, LEVATOR: 1.0}, {ZYGOMATICUS: 0.6, LEVATOR: 0.4}]
    pairs += [{ZYGOMATICUS: z, "jaw_open": jaw} for z, jaw in ((1.0, 0.4), (0.5, 0.2), (0.6, 0.7))]
    pairs += [{LEVATOR: 0.7, "jaw_open": 0.4}, {ZYGOMATICUS: 0.8, LEVATOR: 0.5, "jaw_open": 0.35}]
    poses = [pose_from(values) for values in alone + way + pairs]
    samples = finish(sampling.sampled(reference_model, poses))
    return finish(fit.fit_rig(reference_model, samples, len(alone)))


@pytest.fixture(scope="module")
def chosen(learnt, reference):
    """Few shape keys, chosen on few poses."""
    actor = actor_of(learnt, reference)
    poses = playing.played_poses(actor, np.random.default_rng(0), few=40, many=20, composed=20, looks=10)
    some = (ZYGOMATICUS, LEVATOR, "jaw_open")
    rng = np.random.default_rng(1)
    poses += [{name: rng.uniform() for name in some} for _ in range(80)]
    played = finish(playing.played_parts(actor, poses))
    return finish(keys.chosen_keys(learnt, poses, {part: played[part] for part in ("skin", "mandible")}, {}))


def test_quantities_say_what_a_control_says(learnt, reference_model):
    rng = np.random.default_rng(3)
    names = quantities.sliders(learnt)
    for _ in range(5):
        values = {name: rng.uniform(-1 if name in mixtures.SIGNED else 0, 1) for name in names}
        known = quantities.values_of(quantities.quantities(learnt), {k: np.array([v]) for k, v in values.items()})
        asked = control(reference_model, pose_from(values))
        np.testing.assert_allclose([known[k][0] for k in ("opening", "forward", "aside")], asked.jaw, atol=1e-3)
        lids = [[known[f"lid {lid} {side}"][0] for lid in ("upper", "lower")] for side in "lr"]
        np.testing.assert_allclose(lids, asked.lids, atol=1e-3)
        assert known["gaze l x"][0] == pytest.approx(asked.gaze_of("l")[0] / np.radians(35), abs=1e-3)
    for made in quantities.quantities(learnt).values():
        assert len(made.text(quantities.letters(made))) <= formula.LONGEST


def test_driven_keys_come_with_their_mirror_images(chosen):
    labels = list(chosen.parts["skin"].driven)
    assert 5 < len(labels) <= keys.DRIVEN + 1 and all(label.startswith("~") for label in labels)
    assert keys._mates(["~a_l*b_r", "~b_l*a_r", "~lid upper l 0.6", "~lid upper r 0.6", "~left 2"]) == [1, 0, 3, 2, 4]


def test_a_file_plays_the_simulation_without_the_extension(bpy, chosen, reference, reference_model, tmp_path):
    from headshop.headshop_addon import export, heads, rig_keys, shape_keys

    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    rig_keys.write_rig(skin, chosen)
    assert {ZYGOMATICUS, "jaw_open", "blink_l"} <= set(shape_keys.baked_names(skin))
    assert shape_keys.driven_names(skin) == list(chosen.parts["skin"].driven)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rig.blend"), copy=True)
    exported = export.export_head(skin, tmp_path / "head.glb")
    assert ZYGOMATICUS in exported and not [name for name in exported if name.startswith("~")]
    poses = [{}, {ZYGOMATICUS: 0.8}, {ZYGOMATICUS: 0.7, LEVATOR: 0.6, "jaw_open": 0.3}, {"digastricus_l": 1.0}]
    arguments = [str(tmp_path / "rig.blend"), json.dumps(poses), str(tmp_path / "played.npz")]
    subprocess.run([sys.executable, "-c", _PLAY, *arguments], check=True, capture_output=True, cwd=tmp_path)
    with np.load(tmp_path / "played.npz") as played:
        assert played["simple"]
        np.testing.assert_allclose(played["Skin0"], reference.skin.vertices, atol=1e-4)
        for number, values in enumerate(poses):
            shown = played[f"Skin{number}"] - played["Skin0"]
            np.testing.assert_allclose(shown, chosen.displacement("skin", values), atol=0.02)
        for number, limit in ((1, 0.06), (2, 0.2)):
            asked = control(reference_model, pose_from(poses[number]))
            truth = solve(reference_model, asked, max_iterations=200, tolerance=2e-3).state.skin
            off = np.linalg.norm(played[f"Skin{number}"] - truth, axis=1)
            plain = sum(chosen.parts["skin"].plain[name] * value for name, value in poses[number].items())
            linear = np.linalg.norm(reference.skin.vertices + plain - truth, axis=1)
            assert np.sqrt((off**2).mean()) < limit < np.sqrt((linear**2).mean()), (number, (off**2).mean() ** 0.5)
        lowered = played["Mandible3"] - played["Mandible0"]  # a muscle of the jaw moves bone and skin through the jaw
        frame = JawFrame(reference.skin.vertices, np.asarray(reference.groups["jaw"], float), reference.jaw)
        asked = control(reference_model, Pose({"digastricus_l": 1.0}))
        rigid = frame.placed(np.zeros_like(frame.rest), asked.jaw) - frame.rest
        assert np.abs(lowered).max() > 5 and np.abs(played["Skin3"] - played["Skin0"]).max() > 5
        assert np.abs(np.abs(rigid).max() - np.abs(played["Skin3"] - played["Skin0"]).max()) < 3


def test_a_rig_is_taken_off_again_and_spares_the_artists_keys(bpy, chosen, reference):
    from headshop.headshop_addon import baking, bridge, heads, response, rig_keys

    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    bridge.ensure_shape_key(skin, "sculpted")
    rig_keys.write_rig(skin, chosen)
    rig_keys.write_rig(skin, chosen)  # in place of the first
    count = len(chosen.sliders) + len(chosen.parts["skin"].driven)
    assert len(skin.data.shape_keys.key_blocks) == 2 + count
    assert baking.is_baked(skin)
    baking.remove_baked(skin)
    assert not baking.is_baked(skin)
    assert [block.name for block in skin.data.shape_keys.key_blocks] == ["Basis", "sculpted"]
    assert not len(skin.data.shape_keys.animation_data.drivers) and not rig_keys.is_rigged(skin)
    bridge.ensure_shape_key(skin, ZYGOMATICUS)
    with pytest.raises(InputError, match="of your own"):
        finish(rig_keys.bake_rig(skin))
    with pytest.raises(InputError, match="not prepared"):
        response.stored(skin)


def _kept(skin, learnt):
    from headshop.headshop_addon import response

    skin[response.RESPONSE] = storage.to_bytes(learnt, {"one": {"rms_mm": 0.05}})
    skin[response.OF] = f"{response.fingerprint(skin):08x}"


def test_sliders_play_what_was_learnt(addon, learnt, reference):
    """Instant: the face is the rig's; where the head was reshaped since, the simulation moves it as before."""
    from headshop.headshop_addon import bridge, following, heads, live, response

    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    skin.headshop.model = "INSTANT"
    assert not response.is_prepared(skin) and not response.is_current(skin)
    _kept(skin, learnt)
    live.set_sliders(skin, {ZYGOMATICUS: 0.8, "jaw_open": 0.3})
    acting = actor_of(learnt, reference)
    asked = control(acting, Pose({ZYGOMATICUS: 0.8}, jaw_open=0.3))
    np.testing.assert_allclose(bridge.read_positions(skin, following.KEY), learnt.skin(asked), atol=0.01)
    mandible = heads.parts_of(skin)["mandible"]
    assert np.abs(bridge.read_positions(mandible, following.KEY) - reference.parts["mandible"].vertices).max() > 5
    live.set_sliders(skin, {})
    np.testing.assert_allclose(bridge.read_positions(skin, following.KEY), reference.skin.vertices, atol=1e-4)
    assert following.kept[skin.session_uid].acting is following.INSTANT
    moved = reference.skin.vertices.copy()
    moved[:5] += 1.0
    bridge.write_positions(skin, moved)
    assert response.is_prepared(skin) and not response.is_current(skin)
    with pytest.raises(InputError, match="reshaped"):
        response.stored(skin)
    live.set_sliders(skin, {ZYGOMATICUS: 0.5})
    assert following.kept[skin.session_uid].acting is not following.INSTANT


def test_a_response_learnt_from_another_simulation_is_out_of_date(bpy, learnt, reference, monkeypatch, tmp_path):
    from headshop.headshop_addon import heads, response
    from headshop.sim.response.engine import engine_mark

    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    _kept(skin, learnt)
    assert response.is_current(skin)
    monkeypatch.setattr(response, "engine_mark", lambda: 1)
    assert not response.is_current(skin)
    with pytest.raises(InputError, match="another version"):
        response.stored(skin)
    marks = {engine_mark()}
    for number, text in enumerate(("lid = 1500.0", "lid = 1500.0\r\n", "lid = 1400.0")):
        (tmp_path / str(number) / "sim/tissue").mkdir(parents=True)
        (tmp_path / str(number) / "sim/tissue/parameters.py").write_text(text)
        marks.add(engine_mark(tmp_path / str(number)))
    assert len(marks) == 3  # the ends of lines are the system's
    monkeypatch.setattr("headshop.sim.response.engine.FORMAT", "headshop-response/0")
    assert engine_mark.__wrapped__() not in marks


def test_what_was_learnt_is_appended_with_the_head(bpy, learnt, reference, tmp_path):
    from headshop.headshop_addon import heads, response

    heads.create_head(reference, "Fran")
    _kept(heads.find_heads()[0], learnt)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "head.blend")) as (_, wanted):
        wanted.objects = ["Fran Skin"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["Fran Skin"])
    skin = heads.find_heads()[0]
    rig, accuracy = response.stored(skin)
    assert accuracy == {"one": {"rms_mm": 0.05}}
    asked = control(actor_of(learnt, reference), Pose({LEVATOR: 0.5}))
    np.testing.assert_allclose(rig.skin(asked), learnt.skin(asked), atol=0.01)


def test_a_cancelled_preparation_leaves_no_trace(bpy, reference, reference_model, monkeypatch):
    from headshop.headshop_addon import heads, response

    monkeypatch.setattr("headshop.sim.response.build.build_model", lambda head: reference_model)
    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    work = response.prepare(skin, "quick")
    steps = [next(work) for _ in range(4)]
    work.close()
    assert steps[-1].label.startswith("Simulating pose") and 0 < steps[-1].fraction < 0.1
    assert not response.is_prepared(skin) and response.OF not in skin
