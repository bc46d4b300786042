# SPDX-License-Identifier: GPL-3.0-or-later
"""Range maps as files: written, read again, and refused where they are bad."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.cylindrical.echo_file import echo_bytes, parse_echo
from headshop.sim.cylindrical.map_files import is_range_map, read_range_map, write_range_map
from headshop.sim.cylindrical.png_image import SIGNATURE, png_bytes, read_png
from headshop.sim.cylindrical.range_map import RangeMap
from headshop.sim.cylindrical.sgi_image import read_sgi, sgi_bytes
from headshop.sim.errors import InputError

TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def bumpy(h=24, w=64, closed=True):
    rng = np.random.default_rng(1)
    radius = 80 + 20 * rng.random((h, w))
    radius[3:6, 10:20] = np.nan
    colour = rng.random((h, w, 3), dtype=np.float32)
    colour[3:6, 10:20] = np.nan
    step = 2 * np.pi / w if closed else 0.05
    return RangeMap(radius, np.isfinite(radius), colour, -1.3, step, 31.0, 1.328125, np.array([1.0, 2, 3]), TURN)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("name, near", [("a.ech", 0.004), ("a.npz", 1e-4), ("a.json", 0.006)])
def test_a_map_is_read_as_it_was_written(tmp_path, name, near, closed):
    made = bumpy(closed=closed)
    files = write_range_map(tmp_path / name, made)
    assert all(f.is_file() for f in files) and len(list(tmp_path.iterdir())) == len(files)
    assert is_range_map(tmp_path / name)
    again = read_range_map(tmp_path / name)
    assert np.array_equal(again.valid, made.valid) and again.closed == closed
    np.testing.assert_allclose(again.points(), made.points(), atol=near)
    seen = made.valid
    np.testing.assert_allclose(again.colour[seen], made.colour[seen], atol=0.003)
    bytes_before = [f.read_bytes() for f in files]
    write_range_map(tmp_path / name, made)
    assert bytes_before == [f.read_bytes() for f in files]


def test_a_scanners_file_has_its_front_midway_and_runs_to_the_subjects_right(tmp_path):
    nlg, nlt = 128, 50
    raw = np.full((nlg, nlt), 100_000 >> 3, dtype=">i2")
    raw[64, 10] = 120_000 >> 3  # at the front, below the middle
    raw[64 + 32, 40] = 110_000 >> 3  # a quarter on: the subject's right
    raw[0] = -32768
    header = (
        "Cyberware Digitizer Data\nNAME=heidi\nSPACE=CYLINDRICAL\nCOLOR=SGI\nNLG=128\nLGINCR=49087\nLGMIN=0\nLGMAX=127\n"
        "NLT=50\nLTINCR=2000\nLTMIN=0\nLTMAX=49\nRSHIFT=3\nLGSHIFT=6\nSCALE=100.00\nRPROP=100.00\nDATA=\n"
    )
    path = tmp_path / "heidi"  # such files have no extension
    path.write_bytes(header.encode() + raw.tobytes())
    image = np.zeros((50, 128, 3))
    image[49 - 10, 64] = [1, 0, 0]  # a picture's first row is at the top
    # the scanner's colour file runs as its range does
    (tmp_path / "heidi.color").write_bytes(sgi_bytes(image))
    assert is_range_map(path) and not is_range_map(tmp_path / "absent")
    made = read_range_map(path)
    assert made.shape == (50, 128) and made.closed and made.valid.sum() == 50 * 127
    points = made.points()
    nose = points[np.unravel_index(np.nanargmax(made.radius), made.shape)]
    np.testing.assert_allclose(nose, [0, -120, -30], atol=0.01)
    ear = points[np.unravel_index(np.nanargmax(np.where(made.radius < 115, made.radius, 0)), made.shape)]
    np.testing.assert_allclose(ear, [-110, 0, 30], atol=0.01)
    row, column = np.unravel_index(np.nanargmax(made.colour[..., 0]), made.shape)
    assert made.radius[row, column] == pytest.approx(120, abs=0.01)
    mirrored = header.replace("LGMIN", "THETA_RIGHTHAND=TRUE\nLGMIN").encode() + raw.tobytes()
    other = parse_echo(mirrored, "heidi").points().reshape(-1, 3)
    assert np.linalg.norm(other - [110, 0, 30], axis=1)[np.isfinite(other[:, 0])].min() < 0.01


@pytest.mark.parametrize("offset", [114, 122, 128])
def test_older_headers_are_read_too(offset):
    wide = offset == 128
    head = struct.pack(">II40sIhhbb", 0, offset, b"heidi", 0, 0, 0, 0, 0) + struct.pack(">hhhh", 4, 8, 3, 2)
    head += b"\0\0" * wide + struct.pack(">iiiii", 0, 2000, 785398, 8000, 6283184)
    head += struct.pack(">bxhhhhh", 1, 0, 0, 3, 0, 7)
    raw = np.full((8, 4), 100_000 >> 3, dtype=">i2")
    made = parse_echo(head.ljust(offset, b"\0") + raw.tobytes(), "heidi")
    assert made.shape == (4, 8) and made.closed
    np.testing.assert_allclose(made.radius, 100.0)
    assert made.rise == 2.0


def test_run_length_coded_colours_are_read():
    row = bytes([0x80 | 3, 9, 8, 7, 5, 200, 0])  # three values, then five of 200
    table = struct.pack(">6I", *[512 + 48] * 6) + struct.pack(">6I", *[len(row)] * 6)
    head = struct.pack(">HBBHHHH", 474, 1, 1, 3, 8, 2, 3).ljust(512, b"\0")
    image = read_sgi(head + table + row, "x.color")
    assert image.shape == (2, 8, 3)
    np.testing.assert_allclose(image[0, :, 1] * 255, [9, 8, 7, 200, 200, 200, 200, 200], atol=1e-3)


@pytest.mark.parametrize("kind", [0, 1, 2, 3, 4])
def test_every_filter_of_a_png_is_undone(kind):
    import zlib

    rng = np.random.default_rng(kind)
    image = rng.integers(0, 65536, (6, 7, 3)).astype(np.uint16)
    raw = image.astype(">u2").view(np.uint8).reshape(6, -1).astype(int)
    left = np.pad(raw, ((0, 0), (6, 0)))[:, : raw.shape[1]]
    up = np.pad(raw, ((1, 0), (0, 0)))[:6]
    corner = np.pad(up, ((0, 0), (6, 0)))[:, : raw.shape[1]]
    guess = left + up - corner
    p, q, r = abs(guess - left), abs(guess - up), abs(guess - corner)
    paeth = np.where((p <= q) & (p <= r), left, np.where(q <= r, up, corner))
    coded = (raw - [0 * raw, left, up, (left + up) // 2, paeth][kind]) % 256
    body = zlib.compress(np.concatenate([np.full((6, 1), kind), coded], axis=1).astype(np.uint8).tobytes())
    whole = png_bytes(image)
    start = whole.index(b"IDAT") - 4
    data = whole[:start] + struct.pack(">I", len(body)) + b"IDAT" + body + b"\0" * 4
    np.testing.assert_array_equal(read_png(data, "x.png"), image)
    np.testing.assert_array_equal(read_png(whole, "x.png"), image)


def bad_files(folder):
    good = replace(bumpy(), colour=None)
    whole = echo_bytes(good)
    yield "cut.ech", whole[:-100], "cut off"
    yield "letter.ech", b"Dear scanner", "no Cyberware"
    yield "endless.ech", b"Cyberware Digitizer Data\nNLG=3\n" * 10, "no end of its header"
    yield "silent.ech", whole.replace(b"LTINCR", b"LTLTLT"), "LTINCR"
    yield "flat.ech", whole.replace(b"CYLINDRICAL", b"CARTESIAN"), "flat range image"
    yield "words.ech", whole.replace(b"NLT=24", b"NLT=xx"), "no number"
    yield "huge.ech", whole.replace(b"NLG=64", b"NLG=640000"), "no sense"
    yield "void.ech", whole[: whole.index(b"DATA=") + 6] + b"\x80\0" * 24 * 64, "no radius"
    yield "empty.npz", b"", "damaged"
    yield "text.npz", b"hello", "damaged"
    np.savez(folder / "other.npz", range=np.ones((4, 4)))
    yield "other.npz", None, "no array radius"
    np.savez(folder / "unsaid.npz", radius=np.ones((4, 4)))
    yield "unsaid.npz", None, "height_step"
    np.savez(folder / "nan.npz", radius=np.full((4, 4), np.nan), height_step=1.0)
    yield "nan.npz", None, "no radius"
    np.savez(folder / "skew.npz", radius=np.ones((4, 4)), height_step=1.0, axes=np.ones((3, 3)))
    yield "skew.npz", None, "right angles"
    np.savez(folder / "colour.npz", radius=np.ones((4, 4)), height_step=1.0, colour=np.ones((2, 2, 3)))
    yield "colour.npz", None, "colours of shape"
    yield "prose.json", b"Dear map", "no JSON"
    yield "marks.json", json.dumps({"format": "headshop-landmarks/1"}).encode(), "describes no range map"
    frame = {"format": "headshop-range/1", "radius": "r.png", "height_step": 1.0}
    np.savez(folder / "nothing.npz", height_step=1.0)
    yield "nothing.npz", None, "docs/fitting.md"
    yield "dot.json", json.dumps(frame | {"radius": "."}).encode(), "no file"
    yield "unnamed.json", json.dumps(frame | {"radius": ""}).encode(), "no file"
    yield "nil.json", json.dumps(frame | {"radius": "r\0.png"}).encode(), "no file"
    (folder / "good.png").write_bytes(png_bytes(np.ones((4, 6), np.uint16)))
    good = frame | {"radius": "good.png"}
    yield "number.json", json.dumps(good | {"colour": 5}).encode(), "no file"
    yield "large.json", json.dumps(good | {"height_step": 10**400}).encode(), "not a number"
    yield "larger.json", json.dumps(good | {"radius_unit_mm": 10**400}).encode(), "no number of mm"
    (folder / "picture.tif").write_bytes(b"II*\0")
    yield "picture.json", json.dumps(frame | {"radius": "picture.tif"}).encode(), "not a PNG image: save it as one"
    header = png_bytes(np.ones((4, 6), np.uint8))
    (folder / "palette.png").write_bytes(header[:25] + b"\3" + header[26:])
    yield "palette.json", json.dumps(frame | {"radius": "palette.png"}).encode(), "palette"
    (folder / "vast.png").write_bytes(header[:16] + b"\0\1\0\0" * 2 + header[24:])
    yield "vast.json", json.dumps(frame | {"radius": "vast.png"}).encode(), "more than is read"
    yield "alone.json", json.dumps(frame | {"radius": "gone.png"}).encode(), "cannot be read"
    (folder / "r.png").write_bytes(png_bytes(np.ones((4, 6), np.uint8)))
    yield "eight.json", json.dumps(frame).encode(), "16 bits"
    (folder / "cut.png").write_bytes(SIGNATURE + png_bytes(np.ones((40, 60), np.uint16))[8:60])
    yield "cut.json", json.dumps(frame | {"radius": "cut.png"}).encode(), "cut off"


def test_bad_files_get_one_sentence_each(tmp_path):
    for name, data, words in bad_files(tmp_path):
        if data is not None:
            (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=words) as caught:
            read_range_map(tmp_path / name)
        assert str(caught.value).count("\n") == 0, name
        assert name.split(".")[0] in str(caught.value) or "r.png" in str(caught.value) or "gone" in str(caught.value)
    with pytest.raises(InputError, match="no name of a range map"):
        write_range_map(tmp_path / "a.ply", bumpy())


def test_the_images_of_a_description_may_lie_in_another_folder(tmp_path):
    made = bumpy()
    write_range_map(tmp_path / "a.json", made)
    (tmp_path / "sub").mkdir()
    document = json.loads((tmp_path / "a.json").read_text())
    for image in ("radius", "colour"):
        (tmp_path / document[image]).rename(tmp_path / "sub" / document[image])
        document[image] = "sub/" + document[image]
    (tmp_path / "a.json").write_text(json.dumps(document))
    assert np.array_equal(read_range_map(tmp_path / "a.json").valid, made.valid)


def test_the_import_takes_maps_for_scans(bpy, tmp_path):
    from headshop.headshop_addon import scan_import

    made = bumpy()
    write_range_map(tmp_path / "a.ech", made)
    mesh = scan_import.read_scan(tmp_path / "a.ech")
    assert len(mesh.vertices) > 0.9 * made.valid.sum() and mesh.colour is not None
    radius = np.linalg.norm((mesh.vertices - made.origin) @ made.axes.T[:, :2], axis=1)
    assert radius.min() > 79 and radius.max() < 101
    (tmp_path / "notes.doc").write_text("no scan")
    with pytest.raises(InputError, match="ECH"):
        scan_import.check_file(tmp_path / "notes.doc")
