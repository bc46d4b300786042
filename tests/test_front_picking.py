# SPDX-License-Identifier: GPL-3.0-or-later
"""A click lands on the scan, over a hole at the depth of its rim, and nowhere outside."""

from types import SimpleNamespace

import numpy as np
import pytest

SIDE = 0.2  # m seen across the view


@pytest.fixture
def view(bpy):
    """An orthographic view from the front, 200 pixels for `SIDE`."""
    from mathutils import Matrix

    turn = Matrix.Rotation(np.pi / 2, 4, "X")  # from Blender's camera axes to a camera that looks along +Y
    looking = (Matrix.Translation((0, -1, 0)) @ turn).inverted()
    window = Matrix.Diagonal((2 / SIDE, 2 / SIDE, -0.01, 1))
    rv3d = SimpleNamespace(view_matrix=looking, perspective_matrix=window @ looking, is_perspective=False)
    rv3d.view_perspective = "ORTHO"
    return SimpleNamespace(width=200, height=200, data=rv3d)


@pytest.fixture
def scan(bpy):
    """A wall at y = -0.1 m with a hole of 12 mm in its middle, and the far side of the head at y = +0.1."""
    from headshop.headshop_addon import bridge
    from headshop.sim.mesh import Mesh

    line = np.linspace(-80, 80, 81)
    x, z = np.meshgrid(line, line)
    corner = np.arange(81 * 81).reshape(81, 81)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    points = np.stack([x, np.full_like(x, -100), z], axis=-1).reshape(-1, 3)
    near = faces[np.linalg.norm(points[faces].mean(axis=1)[:, [0, 2]], axis=1) > 6]
    far, outward = points * [1, -1, 1], (faces + len(points))[:, ::-1]
    mesh = Mesh(np.concatenate([points, far]), np.concatenate([near, outward]).astype(np.int32))
    obj = bridge.mesh_to_object(mesh, "Scan")
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


@pytest.mark.parametrize(
    ("at", "expected"),
    [
        ((151, 121), (0.051, -0.1, 0.021)),  # on the wall
        ((100, 100), (0.0, -0.1, 0.0)),  # in the hole: in mid-air, not on the far side
        ((103, 98), (0.003, -0.1, -0.002)),
        ((199, 199), None),  # beside the scan
    ],
)
def test_a_click_lands_on_the_scan_or_over_its_hole(bpy, view, scan, at, expected):
    from headshop.headshop_addon import picking

    point = picking.on_surface(bpy.context, view, at, scan)
    assert (point is None) == (expected is None)
    if expected is not None:
        assert tuple(point) == pytest.approx(expected, abs=1e-4)


def test_a_scan_turned_inside_out_is_hit_all_the_same(bpy, view, scan):
    from headshop.headshop_addon import picking

    scan.data.flip_normals()
    scan.data.update()
    bpy.context.view_layer.update()
    point = picking.on_surface(bpy.context, view, (151, 121), scan)
    assert tuple(point) == pytest.approx((0.051, -0.1, 0.021), abs=1e-4)


def test_a_moved_and_scaled_scan_is_hit_in_its_own_space(bpy, view, scan):
    from headshop.headshop_addon import picking

    scan.scale = (2, 2, 2)
    scan.location = (0.02, 0.0, 0.0)
    bpy.context.view_layer.update()
    point = picking.on_surface(bpy.context, view, (151, 121), scan)
    assert tuple(point) == pytest.approx((0.0155, -0.1, 0.0105), abs=1e-4)


def test_a_speck_before_the_face_is_clicked_through(bpy, view, scan):
    from headshop.headshop_addon import bridge, picking
    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.specks import specks

    whole = bridge.object_to_mesh(scan)
    corners = np.array([[48.0, -120, 20], [54, -120, 20], [51, -120, 24]])
    dirt, count = np.concatenate([corners, corners - [0, 5, 0]]), len(whole.vertices)
    faces = np.full((2, 4), -1, dtype=np.int32)
    faces[:, :3] = count + np.arange(6).reshape(2, 3)
    mesh = Mesh(np.concatenate([whole.vertices, dirt]), np.concatenate([whole.faces, faces]))
    dirty = bridge.mesh_to_object(mesh, "Dirty")
    bpy.context.scene.collection.objects.link(dirty)
    bpy.context.view_layer.update()
    found = specks(mesh)
    assert found[-6:].all() and not found[whole.triangles].any()
    point = picking.on_surface(bpy.context, view, (151, 121), dirty, found)
    assert tuple(point) == pytest.approx((0.051, -0.1, 0.021), abs=1e-4)
    point = picking.on_surface(bpy.context, view, (151, 121), dirty)
    assert point[1] == pytest.approx(-0.125, abs=1e-4)
    assert not specks(Mesh(dirt, faces - (faces >= 0) * count)).any(), "a scan of specks alone keeps them"


def test_clicks_on_the_sidebar_are_not_clicks_on_the_scan(blender):
    from headshop.headshop_addon import picking

    window = SimpleNamespace(type="WINDOW", x=0, y=0, width=1000, height=800)
    sidebar = SimpleNamespace(type="UI", x=800, y=0, width=200, height=800)
    closed = SimpleNamespace(type="TOOLS", x=0, y=0, width=1, height=800)
    area = SimpleNamespace(type="VIEW_3D", regions=[closed, sidebar, window])
    screen = SimpleNamespace(areas=[area])
    assert picking.viewport_region(screen, 400, 300) is window
    assert picking.viewport_region(screen, 0, 300) is window
    assert picking.viewport_region(screen, 900, 300) is None
    assert picking.viewport_region(screen, 400, 900) is None


def test_a_click_counts_in_any_viewport_and_in_each_view_of_four(blender):
    from headshop.headshop_addon import picking

    four = [SimpleNamespace(type="WINDOW", x=x, y=y, width=500, height=400) for x in (0, 500) for y in (0, 400)]
    beside = SimpleNamespace(type="WINDOW", x=1000, y=0, width=500, height=800)
    below = SimpleNamespace(type="WINDOW", x=0, y=800, width=1500, height=100)
    areas = [("OUTLINER", [below]), ("VIEW_3D", four), ("VIEW_3D", [beside])]
    screen = SimpleNamespace(areas=[SimpleNamespace(type=kind, regions=regions) for kind, regions in areas])
    for region in (*four, beside):
        assert picking.viewport_region(screen, region.x + 10, region.y + 10) is region
    assert picking.viewport_region(screen, 10, 810) is None
