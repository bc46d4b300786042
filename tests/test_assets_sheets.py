# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact sheets without Blender, and the plain rig they show."""

import struct

import numpy as np
import pytest

from headshop.assets.generators.picture import PAGE, Layer, draw, montage, write_png
from headshop.assets.generators.sheets import camera, main
from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.anatomy.head import JAW_PARTS
from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue.jaw import jaw_transform


@pytest.fixture(scope="module")
def head():
    return load_head()


def test_a_square_is_drawn_where_it_is():
    corners = np.array([[-10, 0, -10], [10, 0, -10], [10, 0, 10], [-10, 0, 10]], dtype=float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    view = camera([0, 0, 0], 0, 0, 40, 40)
    image = draw([Layer(corners, triangles, np.array([0.2, 0.9, 0.2]))], view)
    assert image.shape == (40, 40, 3)
    np.testing.assert_allclose(image[2, 2], PAGE)
    assert image[20, 20, 1] > 1.5 * image[20, 20, 0]
    turned = draw([Layer(corners, triangles[:, ::-1], np.array([0.2, 0.9, 0.2]))], view)
    assert turned[20, 20, 1] < image[20, 20, 1]  # the inside of a surface is tinted


def test_lines_hide_behind_what_is_in_front():
    wall = np.array([[-10, 0, -10], [10, 0, -10], [10, 0, 10], [-10, 0, 10]], dtype=float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    view = camera([0, 0, 0], 0, 0, 40, 40)

    def drawn(depth):
        line = np.array([[[-8.0, depth, 0.0], [8.0, depth, 0.0]]])
        return draw([Layer(wall, triangles, np.ones(3), line, np.array([1.0, 0, 0]))], view)

    before, behind = drawn(-1.0), drawn(5.0)
    assert np.ptp(before[19:21, 20], axis=-1).max() > 0.2
    assert np.ptp(behind[19:21, 20], axis=-1).max() < 0.1


def test_png_holds_the_picture(tmp_path):
    image = montage([[np.zeros((4, 6, 3)), np.ones((4, 6, 3))]], gap=2)
    write_png(tmp_path / "a.png", image)
    data = (tmp_path / "a.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n" and data.endswith(b"IEND\xaeB`\x82")
    assert struct.unpack(">II", data[16:24]) == (image.shape[1], image.shape[0]) == (16, 6)


def test_sheets_are_written(tmp_path, capsys):
    assert main([str(tmp_path), "--only", "eyeballs,rows", "--pixels", "60"]) == 0
    assert all((tmp_path / f"{name}.png").stat().st_size > 500 for name in ("eyeballs", "rows"))
    with pytest.raises(SystemExit) as stop:
        main([str(tmp_path), "--only", "hair"])
    assert stop.value.code == 2 and "no sheet 'hair'" in capsys.readouterr().err


def test_plain_rest_is_rest(head):
    posed = plainly_posed(head)
    for name, mesh in head.parts.items():
        np.testing.assert_allclose(posed.parts[name].vertices, mesh.vertices, atol=1e-9, err_msg=name)


def test_plain_jaw_carries_its_parts_and_its_skin(head):
    posed = plainly_posed(head, jaw_open=0.7, jaw_side=0.4)
    rotation, translation = jaw_transform(head.jaw, 0.7, 0.0, 0.4)
    for part in JAW_PARTS:
        np.testing.assert_allclose(posed.parts[part].vertices, head.parts[part].vertices @ rotation.T + translation)
    lips = head.groups["lip_upper"] + head.groups["lip_lower"] > 0  # they lag behind when the jaw goes aside
    rigid = (head.groups["jaw"] > 0.9999) & ~lips
    still = (head.groups["jaw"] < 1e-4) & ~lips
    skin = head.skin.vertices
    assert rigid.sum() > 20 and still.sum() > 500
    np.testing.assert_allclose(posed.skin.vertices[rigid], skin[rigid] @ rotation.T + translation, atol=0.02)
    np.testing.assert_allclose(posed.skin.vertices[still], skin[still], atol=0.02)


def test_plain_blink_shuts_the_eye_asked_for(head):
    posed, at = plainly_posed(head, blink=(1.0, 0.0)), head.landmark_positions()
    now = posed.landmark_positions()
    assert now["ps_l"][2] - now["pi_l"][2] < 0.2 * (at["ps_l"][2] - at["pi_l"][2])
    np.testing.assert_allclose(now["ps_r"], at["ps_r"], atol=1e-6)


def test_plain_gaze_turns_the_eyeballs(head):
    posed = plainly_posed(head, gaze=(0.3, 0.0))
    for eye, side in zip(head.eyes, "lr", strict=True):
        move = posed.parts[f"eye_{side}"].vertices - head.parts[f"eye_{side}"].vertices
        front = head.parts[f"eye_{side}"].vertices[:, 1] < eye.centre[1] - 10
        assert move[front, 0].mean() > 2  # to the subject's left
