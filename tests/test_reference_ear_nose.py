# SPDX-License-Identifier: GPL-3.0-or-later
"""Auricle and nose of the reference skin: every part is there, in order and of human size, on the limit surface."""

import numpy as np
import pytest

from headshop.assets.generators import skin_ear
from headshop.assets.generators.skin_finish import finish_shape
from headshop.assets.generators.skin_layout import skin_layout
from headshop.assets.generators.skin_norms import norms
from headshop.assets.generators.skin_rays import MeasuredHead
from headshop.assets.generators.skin_shape import mean_shape
from headshop.sim.health.cuts import smooth_skin
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_piercing import self_piercings


class Made:
    """The finished skin: cage, limit surface (the cage's vertices first), and the ear in its own frame."""

    def __init__(self):
        self.layout = skin_layout()
        self.cage = Mesh(finish_shape(self.layout, mean_shape()), self.layout.faces)
        self.smooth = smooth_skin(self.cage)
        self.at = self.smooth.vertices[: self.layout.count]
        origin, axes = skin_ear.frame(skin_ear.Side(self.layout, self.cage.vertices))
        self.axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        self.ear = (self.at[self.layout.rings["ear_l"]] - origin) @ self.axes.T
        self.canal = (self.at[self.layout.patches["ear_l"][1:-1, 1]] - origin) @ self.axes.T

    def nose(self, u, v):
        return self.at[self.layout.grid[v, u]]


@pytest.fixture(scope="module")
def made():
    return Made()


def norm(name):
    return next(n for n in norms() if n.name == name)


def cuts_near(mesh, middle, reach):
    near = (np.abs(mesh.vertices[mesh.triangles].mean(axis=1) - middle) < reach).all(axis=1)
    triangles = mesh.triangles[near]
    return len(self_piercings(mesh.vertices, triangles))


def test_helix_scapha_antihelix_and_concha_lie_in_order(made):
    back = slice(13, 18)
    helix, scapha, crest, wall, floor = (made.ear[k, back] for k in (3, 4, 5, 6, 7))
    assert (np.diff([x[:, 0] for x in (floor, wall, crest, scapha, helix)], axis=0) > 0).all()  # from inside outward
    assert (helix[:, 2] - scapha[:, 2] > 2).all() and (crest[:, 2] - scapha[:, 2] > 2).all()
    depth = crest[:, 2].mean() - floor[:, 2]
    assert (depth > 9.5).all() and (depth < 15).all()
    assert made.canal[:, 2].min() < floor[:, 2].min() - 2  # the canal goes on from there


def test_helix_is_the_outermost_and_rolls_over_the_scapha(made):
    rim = made.ear[2:4, 10:23]
    assert rim[..., 2].max() > made.ear[5, 10:23, 2].max()
    lip, scapha = made.ear[3, 14:18], made.ear[4, 14:18]
    wall = np.degrees(np.arctan2(lip[:, 2] - scapha[:, 2], lip[:, 0] - scapha[:, 0]))
    assert (wall > 40).all()


def test_antihelix_parts_into_two_crura_around_a_fossa(made):
    superior, inferior, fossa = made.ear[4, 20, 2], made.ear[5, 20:22, 2].min(), made.ear[4, 22, 2]
    assert superior - fossa > 2 and inferior - fossa > 1.5
    assert superior - made.ear[4, 17, 2] > 1.5  # it divides the fossa from the scapha


def test_tragus_stands_over_the_canal_and_notches_part_it_from_its_neighbours(made):
    tragus = made.ear[3, 4:6]
    assert (tragus[:, 0] > made.ear[5, 4:6, 0] + 1).all()
    assert tragus[:, 2].min() - made.canal[:, 2].min() > 10
    antitragus = made.ear[5, 8]
    for notch in (made.ear[3, 6], made.ear[3, 3]):
        assert tragus[:, 2].min() - notch[2] > 2
    assert antitragus[2] - made.ear[3, 6, 2] > 2 and antitragus[0] > tragus[:, 0].max()


def test_crus_of_the_helix_parts_the_concha(made):
    crus, cymba, canal = made.ear[5, 2, 2], made.ear[5, 1, 2], made.ear[5, 3, 2]
    assert crus - cymba > 2 and crus - canal > 2


def test_auricle_has_the_size_of_the_norms(made):
    long, broad = norm("ear_length"), norm("ear_width")
    outside = made.at[made.layout.rings["ear_l"][1:5]].reshape(-1, 3)
    length = np.linalg.norm(outside[outside[:, 2].argmax()] - outside[outside[:, 2].argmin()])
    assert abs(length - long.mean) < 1.2 * long.sd
    width = np.ptp(made.ear[1:4, :, 0])
    assert abs(width - broad.mean) < 1.2 * broad.sd
    stand = made.at[made.layout.rings["ear_l"][2, 16], 0] - made.at[made.layout.rings["ear_l"][0, 16], 0]
    assert 12 < stand < 22  # the rim stands off the head


def thickness(made, normals):
    """mm of flesh behind the face of helix, scapha, antihelix and lobe."""
    ring = made.layout.rings["ear_l"]
    middle = made.at[ring[4]].mean(axis=0)
    near = np.linalg.norm(made.smooth.vertices[made.smooth.triangles].mean(axis=1) - middle, axis=1) < 45
    head = MeasuredHead(made.smooth.vertices, made.smooth.triangles[near])
    points = np.r_[ring[3, 4:6], ring[3:6, 8:22].ravel()]
    ends = [head.cast(made.smooth.vertices[i] - 1e-3 * normals[i], -normals[i])[0] for i in points]
    return np.linalg.norm(np.array(ends) - made.smooth.vertices[points], axis=1)


def test_auricle_is_two_millimetres_thick(made):
    thick = thickness(made, vertex_normals(made.smooth.vertices, made.smooth.triangles))
    assert np.nanmin(thick) > 2


@pytest.mark.parametrize("surface", ("cage", "smooth"))
def test_neither_ear_nor_nose_cuts_itself(made, surface):
    mesh = getattr(made, surface)
    middle = made.at[made.layout.rings["ear_l"][4]].mean(axis=0)
    assert cuts_near(mesh, middle, (25, 35, 42)) == 0
    assert cuts_near(mesh, made.nose(0, 13) + [0, 12, 6], (19, 20, 20)) == 0


def test_a_folded_ear_is_found(made):
    bent = made.cage.vertices.copy()
    bent[made.layout.rings["ear_l"][5, 12:18]] -= [16.0, 0, 0]
    middle = made.at[made.layout.rings["ear_l"][4]].mean(axis=0)
    assert cuts_near(Mesh(bent, made.layout.faces), middle, (25, 35, 42)) > 5


def test_nose_has_the_size_of_the_norms(made):
    wide, far = norm("nose_width"), norm("nasal_protrusion")
    assert abs(2 * made.nose(4, 14)[0] - wide.mean) < wide.sd
    cage = made.cage.vertices[made.layout.grid[[12, 15], 0], 1]
    for tip, base in (cage, (made.nose(0, 12)[1], made.nose(0, 15)[1])):
        assert abs(base - tip - far.mean) < 1.7 * far.sd


def test_bridge_has_a_back_and_side_planes(made):
    for v in (10, 11):
        top = made.nose(1, v) - made.nose(0, v)
        side = made.nose(3, v) - made.nose(2, v)
        assert np.degrees(np.arctan2(top[1], top[0])) < 20
        assert np.degrees(np.arctan2(side[1], side[0])) > 55


def test_wing_bulges_before_a_crease(made):
    wing, crease, cheek, above = made.nose(4, 14), made.nose(5, 14), made.nose(6, 14), made.nose(4, 12)
    chord = wing + (cheek - wing) * (crease[0] - wing[0]) / (cheek[0] - wing[0])
    assert crease[1] - chord[1] > 3  # deeper than the straight way from wing to cheek
    assert wing[0] > crease[0] and wing[0] - above[0] > 3


def test_nostrils_are_turned_drops_with_a_rim_and_a_deep_cavity(made):
    rings = made.layout.rings["nostril_l"]
    rim = made.at[rings[0]]
    gaps = np.linalg.norm(rim[:, None, :2] - rim[None, :, :2], axis=2)
    front, rear = rim[7], rim[np.argmax(gaps[7])]
    length = np.linalg.norm((front - rear)[:2])
    axis = (rear - front)[:2] / length
    across = (rim[:, :2] - front[:2]) @ [-axis[1], axis[0]]
    assert 10 < length < 18 and 4.5 < np.ptp(across) < 9
    assert 20 < np.degrees(np.arctan2(axis[0], axis[1])) < 55  # converging toward the tip
    along = (rim[:, :2] - front[:2]) @ axis
    assert np.ptp(across[along > length / 2]) > np.ptp(across[along < length / 4])  # a drop: narrow in front
    top = made.at[made.layout.patches["nostril_l"][1, 1]]
    assert top[2] - rim[:, 2].mean() > 9.5
    assert 2 * rim[1, 0] > 4.5 and 2 * rim[1, 0] < 8  # columella
    assert made.nose(4, 14)[0] - rim[5, 0] > 2.5  # flesh of the wing
