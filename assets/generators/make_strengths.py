# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure each muscle's gain on the reference head and write it into ``assets/tables/strengths.json``.

``python -m headshop.assets.generators.make_strengths [HEAD.npz]`` after the reference head or the tissue has changed.
"""

import json
import sys

from ...sim.anatomy.storage import REFERENCE, load_head, write_atomically
from ...sim.tissue.calibration import measured_gains
from ...sim.tissue.model import STRENGTHS, build_model

#: Full solves for each muscle: from a common start the gains have settled by then.
ROUNDS = 10


def main(argv: list[str]) -> int:
    """Rewrite the table in place, one row a muscle."""
    document = json.loads(STRENGTHS.read_text(encoding="utf-8"))
    table = document["muscles"]
    for row in table.values():
        row.pop("gain", None)  # the search starts where it always starts: what it finds owes nothing to the last run
    model = build_model(load_head(argv[0] if argv else REFERENCE), table=table)
    for base, gain in measured_gains(model, table, ROUNDS).items():
        if base in table:
            table[base]["gain"] = gain
    rows = ",\n".join(f"    {json.dumps(name)}: {json.dumps(row)}" for name, row in table.items())
    head = json.dumps({k: v for k, v in document.items() if k != "muscles"}, indent=2)
    text = head[:-2] + ',\n  "muscles": {\n' + rows + "\n  }\n}\n"
    json.loads(text)
    write_atomically(STRENGTHS, text.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
