# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of a scan are taken for those of skin where it shows skin: not hair at its edges, nor eyeballs on the lids."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.mesh import edges, ends_of
from headshop.sim.scan.shown_skin import CELL, _smooth, shown_skin

SKIN, HAIR, WHITE = np.array([0.35, 0.2, 0.12]), np.array([0.01, 0.008, 0.006]), np.array([0.3, 0.3, 0.28])


@pytest.fixture(scope="module")
def scanned(reference):
    """Points strewn evenly over the reference head, the nearest vertex of each, and their colours, unevenly lit skin."""
    rng = np.random.default_rng(5)
    corners = reference.skin.vertices[reference.skin.triangles]
    area = np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1)
    chosen = rng.choice(len(area), 60_000, p=area / area.sum())
    points = np.einsum("kc,kcd->kd", rng.dirichlet(np.ones(3), len(chosen)), corners[chosen])
    colour = SKIN * np.exp(0.15 * rng.standard_normal((len(points), 1)) + 0.04 * rng.standard_normal((len(points), 3)))
    return points, cKDTree(reference.skin.vertices).query(points)[1], colour


def _asked(reference, points, colour, hidden=None, at=None, eyes=None, ends=(), clothed=None):
    marks, eyes = reference.landmark_positions() if at is None else at, eyes or reference.eyes
    return shown_skin(points, colour, reference.skin, reference.groups, marks, eyes, hidden, ends, clothed)


def _scalp(reference):
    """Vertices that hair covers: behind the hairline and above the ears."""
    at = reference.landmark_positions()
    return (reference.skin.vertices[:, 2] > at["tr"][2] + 8) & (reference.groups["scalp"] > 0.5)


def _stripes(points):
    """(k,) bool, 9 mm wide and as far apart."""
    return np.floor(points[:, 0] / 9) % 2 == 0


def _inside(points, what, by=2.5):
    """Those of the points that are ``what`` (k,) bool which lie ``by`` mm from all others."""
    return what & (cKDTree(points[~what]).query(points)[0] > by)


def test_skin_is_skin(reference, scanned):
    points, _, colour = scanned
    assert (_asked(reference, points, colour) == 1).all()
    nothing = np.zeros(len(reference.skin.vertices), dtype=bool)
    assert (_asked(reference, points, colour, nothing) == 1).all()
    assert _asked(reference, points[:0], colour[:0], nothing).shape == (0,)


def test_strands_of_hair_beyond_its_edge_are_not_skin_and_skin_between_them_is(reference, scanned):
    points, nearest, colour = scanned
    hidden, rng = _scalp(reference), np.random.default_rng(1)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    strand = hidden[nearest] | ((away < 28) & _stripes(points))
    colour = np.where(strand[:, None], HAIR * np.exp(0.2 * rng.standard_normal((len(points), 1))), colour)
    trust = _asked(reference, points, colour, hidden)
    own, bare = _inside(points, strand), _inside(points, ~strand) & (away < 25)
    assert (own & ~hidden[nearest]).sum() > 100 < bare.sum()
    assert np.quantile(trust[own & (away < 25)], 0.98) < 0.2
    assert trust[bare].mean() > 0.95
    assert (trust[away > 50] == 1).all()
    pale = np.where(strand[:, None], [0.8, 0.75, 0.65], colour)  # hair may be lighter
    assert np.quantile(_asked(reference, points, pale, hidden)[own & (away < 25)], 0.98) < 0.2


def test_a_collar_is_told_by_its_own_colour_and_hair_by_its(reference, scanned):
    """Dark hair and a white collar, both of which go on a little beyond what they are known to cover: their mean is skin's."""
    points, nearest, colour = scanned
    hidden, low = _scalp(reference), reference.landmark_positions()["gn"][2] - 60
    clothed = (reference.groups["neck"] > 0.5) & (reference.skin.vertices[:, 2] < low)
    strand = hidden[nearest] | ((cKDTree(reference.skin.vertices[hidden]).query(points)[0] < 20) & _stripes(points))
    collar = points[:, 2] < low + 8
    colour = np.where(strand[:, None], HAIR, np.where(collar[:, None], 3 * WHITE, colour))
    trust = _asked(reference, points, colour, hidden, clothed=clothed)
    own, edge = _inside(points, strand) & ~hidden[nearest], _inside(points, collar) & ~clothed[nearest]
    assert min(own.sum(), edge.sum()) > 100
    assert np.quantile(trust[own], 0.95) < 0.2 and np.quantile(trust[edge], 0.95) < 0.2
    assert trust[_inside(points, ~strand & ~collar)].mean() > 0.95
    assert np.median(_asked(reference, points, colour, hidden)[edge]) > 0.8  # nobody knows of it


def test_what_stands_off_the_head_says_nothing_of_hair_or_skin(reference, scanned):
    """A wall behind the head, a hand before the face."""
    points, nearest, colour = scanned
    hidden = _scalp(reference)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    strand = hidden[nearest] | ((away < 28) & _stripes(points))
    colour = np.where(strand[:, None], HAIR, colour)
    own = _inside(points, strand) & (away < 25)
    face = reference.groups["face"][nearest] > 0.5
    middle = np.mean([eye.centre for eye in reference.eyes], axis=0) + [0, 90, 0]
    for chosen, far, kind in ((hidden[nearest], 1.8, [0.1, 0.1, 0.9]), (face & (away > 45), 1.4, HAIR)):
        more = np.tile(middle + far * (points[chosen] - middle), (3, 1)) + 0.01
        everything = np.concatenate([points, more]), np.concatenate([colour, np.tile(kind, (len(more), 1))])
        trust = _asked(reference, *everything, hidden)[: len(points)]
        assert np.quantile(trust[own], 0.95) < 0.2


def test_skin_is_learnt_where_no_hair_hangs(reference, scanned):
    points, nearest, colour = scanned
    hidden = _scalp(reference)
    hidden |= np.linalg.norm(reference.skin.vertices - reference.landmark_positions()["t_l"], axis=1) < 45
    hidden |= np.linalg.norm(reference.skin.vertices - reference.landmark_positions()["t_r"], axis=1) < 45
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    own = (reference.groups["brow_l"] + reference.groups["brow_r"])[nearest] > 0.3
    colour = np.where((hidden[nearest] | (away < 44))[:, None], HAIR, colour)
    trust = _asked(reference, points, colour, hidden)
    high = points[:, 2] > reference.landmark_positions()["t_l"][2] + 5
    hanging = high & (away < 28) & ~hidden[nearest] & ~own
    assert hanging.sum() > 100 and np.quantile(trust[hanging], 0.5) < 0.1


def test_what_looks_like_hair_far_from_any_is_skin(reference, scanned):
    points, nearest, colour = scanned
    hidden = _scalp(reference)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    mole = np.linalg.norm(points - reference.landmark_positions()["gn"], axis=1) < 12
    colour = np.where((hidden[nearest] | mole)[:, None], HAIR, colour)
    assert away[mole].min() > 50
    assert (_asked(reference, points, colour, hidden)[mole] == 1).all()


def test_brows_and_beards_beside_hair_stay(reference, scanned):
    points, nearest, colour = scanned
    at = reference.landmark_positions()
    hidden = reference.skin.vertices[:, 2] > at["sci_l"][2] + 14  # a fringe down to the brows
    hidden |= np.linalg.norm(reference.skin.vertices - at["t_l"], axis=1) < 25  # and hair over an ear
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    brow = reference.groups["brow_l"][nearest] + reference.groups["brow_r"][nearest] > 0.5
    beard = (points[:, 2] < at["t_l"][2]) & (points[:, 1] < at["t_l"][1]) & (away > 20) & (away < 40)
    colour = np.where((hidden[nearest] | brow | beard)[:, None], HAIR, colour)
    trust = _asked(reference, points, colour, hidden)
    for own in (brow & ~hidden[nearest] & (away < 25), beard & (away > 24) & (away < 30)):
        own = _inside(points, own, 1.0)
        assert own.sum() > 20 and trust[own].mean() > 0.95


def test_strands_on_a_nape_are_no_beard(reference, scanned):
    """Behind the ears hair hangs as far as above them."""
    points, nearest, colour = scanned
    at = reference.landmark_positions()
    low, behind = at["t_l"][2] - 10, at["t_l"][1] + 20
    hidden = (reference.skin.vertices[:, 2] > low) & (reference.groups["scalp"] > 0.5)
    hidden |= (reference.skin.vertices[:, 2] > low) & (reference.skin.vertices[:, 1] > behind)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    strand = (points[:, 1] > behind) & (points[:, 2] < low) & (away > 18) & (away < 28) & _stripes(points)
    colour = np.where((hidden[nearest] | strand)[:, None], HAIR, colour)
    own = _inside(points, strand)
    assert own.sum() > 50 and np.quantile(_asked(reference, points, colour, hidden)[own], 0.95) < 0.2


def test_a_cover_that_looks_like_skin_or_is_hardly_seen_tells_nothing(reference, scanned):
    points, nearest, colour = scanned
    hidden = _scalp(reference)
    alike = np.where(hidden[nearest][:, None], 0.9 * colour, colour)
    assert (_asked(reference, points, alike, hidden) == 1).all()
    few = np.flatnonzero(hidden[nearest])[:20]
    some = np.append(np.flatnonzero(~hidden[nearest]), few)
    colour = colour.copy()
    colour[few] = HAIR
    beside = cKDTree(points[few]).query(points[some])[0] > 25
    assert (_asked(reference, points[some], colour[some], hidden)[beside] > 0.9).all()
    assert (_asked(reference, points + [0, 0, 300.0], colour, hidden) == 1).all()


def test_skin_in_the_shade_is_skin_beside_hair(reference, scanned):
    """Light of colour and slopes away from it make skin darker, as far as hair is not as dark."""
    points, nearest, colour = scanned
    hidden = _scalp(reference)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    shaded = ~hidden[nearest] & (np.arange(len(points)) % 4 == 0)  # a quarter of all, anywhere
    colour = np.where(hidden[nearest][:, None], HAIR, np.where(shaded[:, None], 0.45 * colour, colour))
    trust = _asked(reference, points, colour, hidden)
    near = shaded & (away < 25)
    assert near.sum() > 50 and trust[near].mean() > 0.9


def _margin(reference, side):
    lids = reference.groups[f"lid_upper_{side}"] + reference.groups[f"lid_lower_{side}"] > 0.3
    inner = reference.groups["inner"] > 0.5
    pairs = edges(reference.skin.faces)
    pairs = pairs[(inner[pairs[:, 0]] != inner[pairs[:, 1]]) & lids[pairs].any(axis=1)]
    return np.unique(pairs[~inner[pairs]])


def test_the_white_of_an_eye_on_its_lid_is_not_skin(reference, scanned):
    points, _, colour = scanned
    away = cKDTree(reference.skin.vertices[_margin(reference, "l")]).query(points)[0]
    white, far = (away < 7) & _stripes(points), (away > 13) & (away < 15)
    colour = np.where((white | far)[:, None], WHITE, colour)
    colour[points[:, 1] > -40] = [0.1, 0.2, 0.5]  # what is behind the eyes does not count
    trust = _asked(reference, points, colour)
    own, skin = _inside(points, white, 1.5), _inside(points, ~white) & (away < 6)
    assert own.sum() > 50 < skin.sum() and far.sum() > 50
    assert trust[own].mean() < 0.2 and trust[far].min() > 0.98
    assert trust[skin].mean() > 0.95
    shadowed = np.where(white[:, None], 0.1 * WHITE, colour)  # under the lashes
    assert _asked(reference, points, shadowed)[own].mean() < 0.2
    for dark in (0.1 * SKIN, 0.03 * WHITE):  # the lashes themselves, and what is too dark to tell
        assert _asked(reference, points, np.where(white[:, None], dark, colour))[own].mean() > 0.98


def test_shut_lids_show_no_eyeball_whatever_is_on_them(reference, scanned):
    points, _, colour = scanned
    at = dict(reference.landmark_positions())
    at["ps_l"] = at["pi_l"] + [0, 0, 1.0]
    away = cKDTree(reference.skin.vertices[_margin(reference, "l")]).query(points)[0]
    shadow = away < 7
    colour = np.where(shadow[:, None], WHITE, colour)
    assert _asked(reference, points, colour)[away < 5].max() < 0.2
    assert _asked(reference, points, colour, at=at)[shadow].min() == 1


def test_skin_in_light_of_many_colours_is_no_eyeball(reference, scanned):
    points, _, colour = scanned
    away = cKDTree(reference.skin.vertices[_margin(reference, "l")]).query(points)[0]
    cooler = np.arange(len(points)) % 5 == 0  # a fifth of all, anywhere
    colour = np.where(cooler[:, None], colour * [0.7, 1, 1.3], colour)
    assert _asked(reference, points, colour)[cooler & (away < 7)].mean() > 0.8


def test_specks_of_colour_are_judged_with_what_is_about_them(reference, scanned):
    """Single hairs and pores are no reason to leave a place out, and borders are not ragged."""
    points, nearest, colour = scanned
    hidden, rng = _scalp(reference), np.random.default_rng(3)
    away = cKDTree(reference.skin.vertices[hidden]).query(points)[0]
    some = away < 60
    dense = np.concatenate([points[some] + 0.3 * rng.standard_normal((some.sum(), 3)) for _ in range(20)])
    speck = rng.random(len(dense)) < 0.02
    hair = np.tile(hidden[nearest[some]], 20) | speck
    trust = _asked(reference, dense, np.where(hair[:, None], HAIR, np.tile(colour[some], (20, 1))), hidden)
    beside = np.tile((~hidden[nearest] & (away > 12) & (away < 25))[some], 20)
    assert (beside & speck).sum() > 100 and trust[beside & speck].mean() > 0.9


def test_eyes_about_which_little_is_seen_tell_nothing(reference, scanned):
    points, _, colour = scanned
    away = cKDTree(reference.skin.vertices[_margin(reference, "l")]).query(points)[0]
    only = away < 7
    assert (_asked(reference, points[only], np.tile(WHITE, (only.sum(), 1))) == 1).all()
    eyes = [replace(eye, centre=eye.centre + [0, 0, 500.0]) for eye in reference.eyes]
    assert (_asked(reference, points, np.where(only[:, None], WHITE, colour), eyes=eyes) == 1).all()


def test_trust_changes_gradually_from_cell_to_cell_and_many_points_count_for_more_than_few():
    at = np.array([[CELL, 0, 0], [0.0, 0, 0], [-CELL, 0, 0]])
    asked = np.linspace(0.4, -0.4, 9)[:, None] * [CELL, 0, 0]
    even = _smooth(asked, at, np.array([1.0, 0.5, 0]), np.ones(3))
    assert even[0] > 0.55 and even[-1] < 0.45 and (np.diff(even) < 0).all() and np.abs(np.diff(even)).max() < 0.05
    many = _smooth(asked, at, np.array([1.0, 0.5, 0]), np.array([30, 1, 1]))
    assert (many > even + 0.1).all()
    assert (_smooth(asked, at, np.ones(3), np.ones(3)) == 1).all()


def _dotted(reference, points, nearest, share):
    """(k,) bool: specks of hair on the scalp, and one beside it on the forehead, a ``share`` of the scalp's vertices."""
    scalp = np.flatnonzero(reference.groups["scalp"] > 0.5)
    middle = reference.skin.vertices[scalp].mean(axis=0)
    order = np.argsort(np.arctan2(*(reference.skin.vertices[scalp] - middle)[:, :2].T), kind="stable")
    chosen = np.zeros(len(reference.skin.vertices), dtype=bool)
    chosen[scalp[order[: int(share * len(scalp))]]] = True
    at = reference.landmark_positions()
    below = points[np.linalg.norm(points - (0.75 * at["tr"] + 0.25 * at["n"]), axis=1).argmin()]
    return chosen[nearest] | (np.linalg.norm(points - below, axis=1) < 5.0)


@pytest.mark.parametrize("kind", [HAIR, [0.75, 0.75, 0.75]])
def test_specks_of_hair_on_a_scalp_that_is_not_seen_are_not_skin(reference, scanned, kind):
    points, nearest, colour = scanned
    hair = _dotted(reference, points, nearest, 0.1)
    scalp = reference.groups["scalp"][nearest] > 0.5
    away = cKDTree(reference.skin.vertices[reference.groups["scalp"] > 0.5]).query(points)[0]
    colour = np.where(hair[:, None], kind, colour)
    seen = hair | ~scalp
    trust = _asked(reference, points[seen], colour[seen])
    specks = _inside(points[seen], hair[seen], 1.0)
    assert (specks & ~scalp[seen]).sum() > 20 < (specks & scalp[seen]).sum()
    assert np.quantile(trust[specks], 0.95) < 0.3
    assert (trust[~hair[seen] & (away[seen] > 25)] == 1).all()


def test_a_speck_at_a_temple_is_hair_and_one_on_a_cheek_is_not(reference, scanned):
    points, nearest, colour = scanned
    away = cKDTree(reference.skin.vertices[reference.groups["scalp"] > 0.5]).query(points)[0]
    seen = reference.groups["scalp"][nearest] <= 0.5
    temple = seen & (points[:, 2] > reference.landmark_positions()["sci_l"][2]) & (away > 20) & (away < 22)
    cheek = seen & (reference.groups["cheek_l"][nearest] > 0.9) & (away > 35)
    for place, hair in ((temple, True), (cheek, False)):
        middle = points[place][len(points[place]) // 2]
        speck = seen & (np.linalg.norm(points - middle, axis=1) < 6.0) & ((away > 19) & (away < 23) | (not hair))
        trust = _asked(reference, points[seen], np.where(speck[:, None], HAIR, colour)[seen])
        assert speck.sum() > 10
        assert np.median(trust[speck[seen]]) < 0.3 if hair else (trust == 1).all()


def test_a_scalp_that_is_seen_has_its_own_colour(reference, scanned):
    """Shaved hair, on all of it or a good part."""
    points, nearest, colour = scanned
    for share in (0.35, 1.0):
        hair = _dotted(reference, points, nearest, share)
        assert (_asked(reference, points, np.where(hair[:, None], HAIR, colour)) == 1).all()


def test_what_is_unlike_the_skin_of_a_motley_face_says_nothing_of_hair(reference, scanned):
    points, nearest, colour = scanned
    hair = _dotted(reference, points, nearest, 0.1)
    seen = hair | (reference.groups["scalp"][nearest] <= 0.5)
    colour = np.where(hair[:, None], SKIN * 0.4, colour)
    assert _asked(reference, points[seen], colour[seen])[hair[seen]].mean() < 0.4
    face = (reference.groups["face"][nearest] > 0.5) & _stripes(points)
    motley = np.where(face[:, None], colour * 0.3, colour)
    assert (_asked(reference, points[seen], motley[seen]) == 1).all()


def test_hair_that_is_hardly_unlike_skin_is_a_scalps_own_where_much_of_it_is_seen(reference, scanned):
    """As on the sample: a third of the scalp, of which less than a fifth is as unlike as specks are."""
    points, nearest, colour = scanned
    hair, dark = (_dotted(reference, points, nearest, share) for share in (0.35, 0.15))
    colour = np.where(hair[:, None], np.where(dark[:, None], HAIR, SKIN * 0.5), colour)
    assert (_asked(reference, points, colour) == 1).all()


def test_brows_and_moles_are_not_hair_of_the_scalp(reference, scanned):
    """On a low forehead brows are near it."""
    points, nearest, colour = scanned
    skin, at = reference.skin.vertices, reference.landmark_positions()
    brow = np.maximum(reference.groups["brow_l"], reference.groups["brow_r"]) > 0.3
    low = ~brow & (skin[:, 2] > skin[brow][:, 2].max()) & (skin[:, 2] < at["tr"][2])
    head = replace(reference, groups=reference.groups | {"scalp": np.where(low, 1.0, reference.groups["scalp"])})
    assert (cKDTree(skin[head.groups["scalp"] > 0.5]).query(skin[brow])[0] < 12).any()
    dark = brow[nearest] | (np.linalg.norm(points - at["prn"], axis=1) < 5)
    trust = _asked(head, points, np.where(dark[:, None], HAIR, colour))
    assert (trust[brow[nearest]] > 0.99).all() and (trust[np.linalg.norm(points - at["prn"], axis=1) < 5] == 1).all()


@pytest.fixture(scope="module")
def cut_off(reference, scanned):
    """What of the points lies before the temples' hair, where it ends, and the colours; mm to there."""
    points, _, colour = scanned
    at = reference.landmark_positions()
    before = (at["ft_l"][1] + at["ft_r"][1]) / 2 + 12 - points[:, 1]
    ends = points[np.abs(before) < 0.5]
    return points[before > 0], ends, colour[before > 0], cKDTree(ends).query(points[before > 0])[0]


def test_hair_where_a_scan_ends_above_the_eyes_is_not_skin(reference, cut_off):
    points, ends, colour, away = cut_off
    at = reference.landmark_positions()
    high = (points[:, 2] > at["ex_l"][2] + 32) & (points[:, 2] < at["tr"][2])  # above the tails of the brows
    hair = high & (away < 7)
    colour = np.where(hair[:, None], 0.3 * colour, colour)  # darker, and of skin's own hue, as in coloured light
    trust = _asked(reference, points, colour, ends=ends)
    sure = _inside(points, hair)
    assert sure.sum() > 100
    assert np.median(trust[sure]) < 0.1
    assert np.quantile(trust[sure], 0.98) < 0.5, "so little counts as nothing"
    assert trust[_inside(points, ~hair)].mean() > 0.99
    assert (_asked(reference, points, colour) == 1).all(), "nobody said where the scan ends"
    wide = np.where((high & (away < 13))[:, None] & ~hair[:, None], 0.3 * colour, colour)
    fading = _asked(reference, points, wide, ends=ends)[high & (away > 11) & (away < 12)]
    assert 0.3 < fading.mean() < 0.8
    shade = np.where(hair[:, None], 2.4 * colour, colour)  # a quarter darker
    assert _asked(reference, points, shade, ends=ends)[hair].mean() > 0.95


def test_dark_skin_is_skin_below_the_eyes_far_from_where_a_scan_ends_and_on_brows(reference, cut_off):
    points, ends, colour, away = cut_off
    at = reference.landmark_positions()
    ex = at["ex_l"][2]
    low = (points[:, 2] < ex) & (away < 7)
    far = (points[:, 2] > ex) & (away > 16) & (away < 24)
    own = reference.groups["brow_l"] + reference.groups["brow_r"] > 0.3
    brow = own[cKDTree(reference.skin.vertices).query(points)[1]]
    for dark in (low, far):
        assert (_asked(reference, points, np.where(dark[:, None], 0.3 * colour, colour), ends=ends) == 1).all()
    trust = _asked(reference, points, np.where(brow[:, None], 0.1 * colour, colour), ends=points[brow])
    assert trust[_inside(points, brow)].min() > 0.9


def test_a_shaven_scalp_keeps_its_colour_to_where_the_scan_ends(reference, scanned):
    points, nearest, colour = scanned
    scalp = _scalp(reference)[nearest]
    top = reference.skin.vertices[:, 2].max()
    shaven = np.where(scalp[:, None], 0.5 * colour, colour)
    ends = points[scalp & (points[:, 2] > top - 30)]
    assert (_asked(reference, points, shaven, ends=ends) == 1).all()


def test_what_ends_where_no_skin_is_seen_beside_it_says_nothing(reference, cut_off):
    points, ends, colour, away = cut_off
    dark = np.where(((away < 7) & (points[:, 0] > 0))[:, None], 0.3 * colour, colour)
    assert _asked(reference, points, dark, ends=ends).min() < 0.1
    for seen in (away < 12, (away < 12) | (points[:, 0] < 0)):  # none, and that of the other side
        here = seen & (away < np.where(points[:, 0] > 0, 12, np.inf)) & (np.abs(points[:, 0]) > 30)
        assert (_asked(reference, points[here], dark[here], ends=ends) == 1).all()


def test_a_scan_ends_at_sides_of_one_triangle():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0], [9, 9, 9]], dtype=float)
    fan = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    assert sorted(map(tuple, ends_of(square, np.array(fan)))) == sorted(map(tuple, square[:4]))
    assert ends_of(square, np.array([*fan, [1, 0, 3], [3, 2, 1]])).shape == (0, 3)
