# SPDX-License-Identifier: GPL-3.0-or-later
"""Every shipped asset comes out of its generator again.

The generators take a minute: the tests run where CI or HEADSHOP_REBUILD is set. Bytes are compared with
HEADSHOP_REBUILD; elsewhere numbers, as another processor's linear algebra may differ in its last bits.
"""

import json
import os
import shutil

import numpy as np
import pytest

from headshop.assets.generators import make_expression_responses, make_reference_head, make_strengths
from headshop.sim.anatomy.storage import REFERENCE, anatomy_document, load_head
from headshop.sim.relax.responses import TABLE
from headshop.sim.tissue.model import STRENGTHS

pytestmark = pytest.mark.skipif(
    not {"HEADSHOP_REBUILD", "CI"} & set(os.environ), reason="takes a minute: set HEADSHOP_REBUILD to run it"
)
#: Byte for byte.
EXACT = "HEADSHOP_REBUILD" in os.environ


def numbers(document):
    """All numbers of a JSON document in order."""
    if isinstance(document, dict):
        return [x for key in sorted(document) for x in numbers(document[key])]
    if isinstance(document, list):
        return [x for each in document for x in numbers(each)]
    return [float(document)] if isinstance(document, int | float) and not isinstance(document, bool) else []


def test_the_reference_head(tmp_path, strided):
    assert make_reference_head.main([str(tmp_path / "head.npz")]) == 0
    assert not strided
    new, old = load_head(tmp_path / "head.npz"), load_head()
    for name, mesh in old.parts.items():
        np.testing.assert_array_equal(new.parts[name].faces, mesh.faces, err_msg=name)
        np.testing.assert_allclose(new.parts[name].vertices, mesh.vertices, atol=1e-3, err_msg=name)
    assert list(new.groups) == list(old.groups)
    for name, weights in old.groups.items():
        np.testing.assert_allclose(new.groups[name], weights, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(numbers(anatomy_document(new)), numbers(anatomy_document(old)), atol=2e-3)
    if EXACT:
        assert (tmp_path / "head.npz").read_bytes() == REFERENCE.read_bytes()


def test_the_strengths(tmp_path, monkeypatch):
    copy = tmp_path / "strengths.json"
    shutil.copy(STRENGTHS, copy)
    monkeypatch.setattr(make_strengths, "STRENGTHS", copy)
    assert make_strengths.main([]) == 0
    new, old = (json.loads(path.read_text(encoding="utf-8")) for path in (copy, STRENGTHS))
    np.testing.assert_allclose(numbers(new), numbers(old), rtol=0.01, atol=0.01)
    if EXACT:
        assert copy.read_bytes() == STRENGTHS.read_bytes()


def test_the_responses(tmp_path):
    assert make_expression_responses.main([str(tmp_path / "responses.npz")]) == 0
    with np.load(tmp_path / "responses.npz") as new, np.load(TABLE) as old:
        assert set(new.files) == set(old.files)
        for name in old.files:
            np.testing.assert_allclose(new[name].astype(float), old[name].astype(float), atol=0.1, err_msg=name)
    if EXACT:
        assert (tmp_path / "responses.npz").read_bytes() == TABLE.read_bytes()
