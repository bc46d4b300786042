# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentence about a fit: what was fitted, how well, and what was invented."""

import numpy as np

from headshop.sim.adapt.fit_sentence import LEFT_OUT, fit_sentence, fitted_shares, invented
from headshop.sim.adapt.scan_surface import NO_SKIN


def test_the_sentence_names_what_was_invented(reference):
    x, y, z = reference.skin.vertices.T
    everything = np.ones(len(x))
    assert invented(fitted_shares(reference, everything)) == []
    fit = {"coverage": 0.834, "mean_mm": 0.1372, "p95_mm": 0.4199}
    assert fit_sentence(fit, []) == (
        "Fitted 83 % of the face to 0.14 mm on average (95 % within 0.42 mm); nothing was invented."
    )
    seen = everything.copy()
    seen[(x > 0) & (y > -30)] = 0  # the left side of the head
    names = invented(fitted_shares(reference, seen))
    assert "left ear" in names and not any("right" in name or "both" in name for name in names)
    assert fit_sentence(fit, names).endswith(f"invented: {', '.join(names)}.")


def test_both_sides_are_said_once(reference):
    seen = np.ones(len(reference.skin.vertices))
    for side in ("l", "r"):
        seen[np.asarray(reference.groups[f"ear_{side}"]) > 0.5] = 0
    seen[np.asarray(reference.groups["neck"]) > 0.3] = 0
    assert invented(fitted_shares(reference, seen)) == ["both ears", "neck"]


def test_a_little_data_is_said(reference):
    shares = fitted_shares(reference, np.zeros(len(reference.skin.vertices)))
    assert set(shares.values()) == {0.0} and "both eyelids" in invented(shares)
    assert invented({"left ear": 0.3, "right ear": 0.2}) == ["most of both ears"]
    assert invented({"left ear": 0.3, "right ear": 0.0}) == ["most of the left ear", "right ear"]
    assert invented({"neck": 0.3, "nose": 0.9}) == ["most of the neck"]


def test_all_that_may_be_left_out_has_a_name():
    assert set(LEFT_OUT) == set(NO_SKIN)
