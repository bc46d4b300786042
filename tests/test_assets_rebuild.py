# SPDX-License-Identifier: GPL-3.0-or-later
"""Every shipped asset comes out of its generator again.

The generators take a minute: the tests run where CI or HEADSHOP_REBUILD is set. Bytes are compared with
HEADSHOP_REBUILD; elsewhere numbers, as another processor's linear algebra may differ in its last bits. Where these decide
between two vertices as near, skin under the chin and muscles come out otherwise by some tenths of a millimetre.
"""

import json
import os
import shutil

import numpy as np
import pytest

from headshop.assets.generators import make_reference_head, make_strengths
from headshop.sim.anatomy.storage import REFERENCE, anatomy_document, load_head
from headshop.sim.tissue.model import STRENGTHS

pytestmark = pytest.mark.skipif(
    not {"HEADSHOP_REBUILD", "CI"} & set(os.environ), reason="takes a minute: set HEADSHOP_REBUILD to run it"
)
#: Byte for byte with one thread of linear algebra, as `make assets` sets it.
EXACT = "HEADSHOP_REBUILD" in os.environ and os.environ.get("OPENBLAS_NUM_THREADS") == "1"


def numbers(document):
    """All numbers of a JSON document in order."""
    if isinstance(document, dict):
        return [x for key in sorted(document) for x in numbers(document[key])]
    if isinstance(document, list):
        return [x for each in document for x in numbers(each)]
    return [float(document)] if isinstance(document, int | float) and not isinstance(document, bool) else []


def same(new, old, most, share, name=""):
    """No number is off by more than ``most``, and no more than a ``share`` of them by more than rounding."""
    off = np.abs(np.subtract(new, old))
    assert off.max(initial=0.0) < most and (off > 2e-3).mean() <= share, (name, off.max(), (off > 2e-3).mean())


def test_the_reference_head(tmp_path):
    assert make_reference_head.main([str(tmp_path / "head.npz")]) == 0
    new, old = load_head(tmp_path / "head.npz"), load_head()
    for name, mesh in old.parts.items():
        np.testing.assert_array_equal(new.parts[name].faces, mesh.faces, err_msg=name)
        same(new.parts[name].vertices, mesh.vertices, 0.3, 0.02, name)
    assert list(new.groups) == list(old.groups)
    for name, weights in old.groups.items():
        np.testing.assert_allclose(new.groups[name], weights, atol=1e-3, err_msg=name)
    same(numbers(anatomy_document(new)), numbers(anatomy_document(old)), 1.0, 0.1)
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
