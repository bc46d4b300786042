# SPDX-License-Identifier: GPL-3.0-or-later
"""Every panel draws in every state of the work, names only what exists, and always says what to do next."""

from types import SimpleNamespace

import pytest


class _Layout:
    """Stands in for a layout: checks what is asked of it against Blender and keeps what is written."""

    def __init__(self, bpy, seen):
        self._bpy, self._seen = bpy, seen
        self._icons = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys()

    def _icon(self, options):
        assert options.get("icon", "NONE") in self._icons, options["icon"]

    def _child(self, *_, **__):
        return _Layout(self._bpy, self._seen)

    row = column = split = box = grid_flow = _child

    def label(self, *, text="", **options):
        self._icon(options)
        self._seen.append(text)

    def operator(self, idname, *, text=None, **options):
        self._icon(options)
        module, _, name = idname.partition(".")
        assert name in dir(getattr(self._bpy.ops, module)), f"no operator {idname}"
        cls = getattr(self._bpy.types, f"{module.upper()}_OT_{name}")
        self._seen.append(text if text is not None else cls.bl_label)
        return _Properties(set(getattr(self._bpy.ops.headshop, name).get_rna_type().properties.keys()))

    def prop(self, data, name, **options):
        self._icon(options)
        assert name in data.bl_rna.properties, name
        self._seen.append(options.get("text", data.bl_rna.properties[name].name))

    def progress(self, *, factor, type, text):
        assert 0 <= factor <= 1 and type in ("BAR", "RING")
        self._seen.append(text)

    def template_list(self, cls, _id, data, name, active_data, active_name, **_):
        assert hasattr(self._bpy.types, cls) and name in data.bl_rna.properties
        assert active_name in active_data.bl_rna.properties
        self._seen.append(name)


class _Properties:
    def __init__(self, known):
        object.__setattr__(self, "_known", known)

    def __setattr__(self, name, value):
        assert name in self._known, f"the operator has no property {name}"


def draw_all(bpy) -> dict[str, list[str]]:
    """Panel -> everything written in it; panels whose poll says no are absent."""
    context = SimpleNamespace(
        scene=bpy.context.scene,
        active_object=bpy.context.active_object,
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        region=SimpleNamespace(width=260),
        view_layer=bpy.context.view_layer,
        mode=bpy.context.mode,
    )
    out = {}
    for name in sorted(dir(bpy.types)):
        if name.startswith("HEADSHOP_PT_"):
            cls = getattr(bpy.types, name)
            if "poll" in dir(cls) and not cls.poll(context):
                continue
            seen: list[str] = []
            cls.draw(SimpleNamespace(layout=_Layout(bpy, seen), bl_label=cls.bl_label), context)
            assert seen, f"{name} is empty"
            out[name] = seen
    return out


def _text(drawn, panel):
    return " ".join(drawn[f"HEADSHOP_PT_{panel}"])


def test_an_empty_scene_tells_where_to_start(addon):
    drawn = draw_all(addon)
    assert "Start here" in _text(drawn, "scan")
    for panel in ("landmarks", "build", "muscles", "expressions", "bake"):
        assert "first" in _text(drawn, panel) or "scan with" in _text(drawn, panel)
    assert not any(name.startswith("HEADSHOP_PT_muscles_") for name in drawn)


@pytest.fixture
def scan(scan_object):
    return scan_object


def test_landmarks_are_counted_until_a_head_can_be_built(addon, scan, reference):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    assert "four are enough" in _text(draw_all(addon), "landmarks")
    for name in ("prn", "ex_r"):
        scan_landmarks.put(scan, name, truth[name])
    assert "2 placed, 2 more needed" in _text(draw_all(addon), "landmarks")
    assert "at least four" in _text(draw_all(addon), "build")
    scan_landmarks.replace(scan, {n: truth[n] for n in ("prn", "ex_r", "ex_l", "gn")})
    drawn = draw_all(addon)
    assert "4 placed, 56 estimated" in _text(drawn, "landmarks") and "Ready" in _text(drawn, "build")
    assert drawn["HEADSHOP_PT_landmark_list"] == ["landmarks"], "nothing is chosen yet"
    scan.headshop.landmark_index = 0
    assert "Place v" in _text(draw_all(addon), "landmark_list")


def test_found_landmarks_are_told_from_those_in_mid_air_and_the_next_to_correct_is_named(addon, scan, reference):
    from headshop.headshop_addon import jobs, scan_landmarks
    from headshop.sim.anatomy.landmark_names import SKIN
    from headshop.sim.landmarks.find import FoundLandmarks

    truth = {n: p for n, p in reference.landmark_positions().items() if n in SKIN}
    confidence = dict.fromkeys(truth, 0.9) | {"zy_r": 0.2, "op": 0.1, "v": 0.1}
    scan_landmarks.take_found(scan, FoundLandmarks(truth, confidence, ("op", "v"), ()))
    drawn = draw_all(addon)
    text = _text(drawn, "landmarks")
    assert "58 found, 2 in mid-air" in text and "placed" not in text and "Ready" in _text(drawn, "build")
    assert "Correct zy_r" in text and "subject's right" in text
    scan_landmarks.put(scan, "zy_r", truth["zy_r"])
    scan_landmarks.follow(scan)
    text = _text(draw_all(addon), "landmarks")
    assert "57 found, 2 in mid-air, 1 placed" in text and "Correct zy_r" not in text
    jobs.running = jobs.Running("Find Landmarks", "landmarks", 0.1, "Looking")
    try:
        assert "Correct" not in _text(draw_all(addon), "landmarks"), "nothing to press while it looks"
    finally:
        jobs.running = None


def test_how_the_file_was_read_is_shown_and_doubt_is_said(addon, scan):
    import json

    from headshop.headshop_addon import heads

    facts = {"unit": "m", "up": "+Y", "front": "+Z", "certain": True, "zero_area_faces": 7, "duplicate_faces": 2}
    scan[heads.REPORT] = json.dumps({"scan": facts})
    text = _text(draw_all(addon), "scan")
    assert "Read as m, +Y up, facing +Z" in text and "9 faulty" in text and "Unsure" not in text
    scan[heads.REPORT] = json.dumps({"scan": facts | {"certain": False}})
    assert "Unsure" in _text(draw_all(addon), "scan")
    for unit, said in (("face", "1 unit = 71.8 mm, by the face"), ("custom", "1 unit = 71.8 mm")):
        scan[heads.REPORT] = json.dumps({"scan": facts | {"unit": unit, "unit_scale": 71.787}})
        text = _text(draw_all(addon), "scan")
        assert said in text and "Read as +Y up, facing +Z" in text and ("by the face" in text) == (unit == "face")


def test_sheets_that_overlapped_are_told(addon, scan):
    import json

    from headshop.headshop_addon import heads

    scan[heads.REPORT] = json.dumps({"scan": {"sheets": 4, "sheets_apart_mm": 0.84}})
    assert "4 overlapping sheets, laid onto each other: 0.8 mm apart" in _text(draw_all(addon), "scan")


def test_what_is_left_of_a_scan_that_is_not_chosen_or_deleted(addon, scan, reference):
    """Its field stays, so that it can be chosen again; a deleted one has no switch."""
    from headshop.headshop_addon import heads

    scan[heads.PART] = "scan"
    heads.create_head(reference, "Ref", scan)
    assert "Scan" in draw_all(addon)["HEADSHOP_PT_build"]
    addon.context.scene.headshop.scan = None
    drawn = draw_all(addon)["HEADSHOP_PT_scan"]
    assert "" in drawn and "Start here" not in " ".join(drawn)
    for collection in scan.users_collection:
        collection.objects.unlink(scan)
    assert "Scan" not in draw_all(addon)["HEADSHOP_PT_build"] and "Start here" in _text(draw_all(addon), "scan")


def test_a_landmark_that_counts_can_be_left_out(addon, scan, reference):
    from headshop.headshop_addon import scan_landmarks

    scan_landmarks.replace(scan, {n: p for n, p in reference.landmark_positions().items() if n != "ch_r"})
    names = [item.name for item in scan.headshop.landmarks]
    for name, there in (("prn", True), ("ch_r", False)):
        scan.headshop.landmark_index = names.index(name)
        drawn = draw_all(addon)["HEADSHOP_PT_landmark_list"]
        assert f"Place {name}" in drawn and ("Leave Out" in drawn) == there


def test_a_head_shows_every_slider_once_and_every_expression(addon, reference):
    from headshop.headshop_addon import heads
    from headshop.sim.acting.expressions import expressions

    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    fit = {"mean_mm": 0.4, "p95_mm": 1.5, "landmark_mean_mm": 2.0, "advice": "Build it anew."}
    heads.write_report(skin, {"fit": fit})
    drawn = draw_all(addon)
    assert "0.40 mm" in _text(drawn, "build") and "Build it anew." in _text(drawn, "build")
    sliders = sum((seen for name, seen in drawn.items() if name.startswith("HEADSHOP_PT_muscles_")), [])
    sides = [text for text in sliders if text in ("L", "R")]
    paired = [muscle for muscle in reference.muscles if muscle.name.endswith(("_l", "_r"))]
    assert len(sides) == len(paired)
    assert len(drawn["HEADSHOP_PT_expressions"]) == 1 + len(expressions())


def test_without_scipy_the_first_panel_says_what_to_do(addon, monkeypatch):
    from headshop.headshop_addon import dependencies

    monkeypatch.setattr(dependencies, "available", lambda name: name != "scipy")
    drawn = draw_all(addon)
    assert "scipy" in _text(drawn, "scan") and "install" in _text(drawn, "scan")
    with pytest.raises(RuntimeError, match="scipy"):
        addon.ops.headshop.make_sample()


def test_without_xatlas_only_repacking_is_grey(addon, reference, monkeypatch):
    from headshop.headshop_addon import dependencies, heads

    heads.create_head(reference, "Ref")
    monkeypatch.setattr(dependencies, "available", lambda name: name != "xatlas")
    assert "xatlas" in _text(draw_all(addon), "build")
    with pytest.raises(RuntimeError, match="xatlas"):
        addon.ops.headshop.repack_uv()
    for name in ("build_head", "bake_expressions", "set_expression", "export_head"):
        assert getattr(addon.ops.headshop, name).poll() or name == "build_head"


def test_the_preferences_name_the_libraries(addon, monkeypatch):
    from headshop.headshop_addon import dependencies
    from headshop.headshop_addon.preferences import HEADSHOP_AP_preferences, preferences

    monkeypatch.setattr(dependencies, "available", lambda name: name != "xatlas")
    assert preferences(addon.context).text_size == 11
    seen: list[str] = []
    settings = SimpleNamespace(layout=_Layout(addon, seen), bl_rna=HEADSHOP_AP_preferences.bl_rna)
    HEADSHOP_AP_preferences.draw(settings, addon.context)
    text = " ".join(seen)
    assert "scipy 1." in text and "xatlas is missing" in text


def test_what_is_inside_can_be_shown(addon, reference):
    from headshop.headshop_addon import active, heads

    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    muscles = active.muscles_collection(skin)
    assert muscles.name == "Ref Muscles" and len(muscles.objects) == len(reference.muscles)
    assert draw_all(addon)["HEADSHOP_PT_build"].count("Muscles") == 1


@pytest.mark.parametrize("panel", ["build", "muscles", "bake"])
def test_a_running_job_is_shown_once(addon, reference, panel):
    from headshop.headshop_addon import heads, jobs

    heads.create_head(reference, "Ref")
    jobs.running = jobs.Running("Some Job", panel, 0.42, "Refining")
    try:
        drawn = draw_all(addon)
        assert [name for name in drawn if "Some Job: 42%" in drawn[name]] == [f"HEADSHOP_PT_{panel}"]
    finally:
        jobs.running = None


def test_a_part_with_other_vertices_is_named_where_its_sliders_are(addon, reference):
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    assert "instead of" not in " ".join(draw_all(addon)["HEADSHOP_PT_muscles"])
    addon.context.view_layer.objects.active = skin
    skin.select_set(True)
    addon.ops.object.convert(target="MESH")  # which applies the subdivision
    said = " ".join(draw_all(addon)["HEADSHOP_PT_muscles"])
    assert f"'Ref Skin' has {len(skin.data.vertices)} vertices instead of" in said and "build the head again" in said
