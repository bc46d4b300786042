# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the numbers of heads as a table: ``python -m headshop.assets.generators.head_numbers [FILE …] [--individuals N]``.

Without a file, the reference head; ``--individuals`` adds N random ones made of it. Exit status 1 where a number is
outside its limits.
"""

import argparse
import sys

import numpy as np

from ...sim.anatomy.storage import load_head
from ...sim.health.numbers import LIMITS, numbers
from ...sim.scan.individual import individual


def main(argv: list[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="*", help="heads (.npz); the first is what individuals are made of")
    parser.add_argument("--individuals", type=int, default=0, metavar="N", help="random heads to measure as well")
    parser.add_argument("--details", action="store_true", help="say what is behind each number that is out of bounds")
    options = parser.parse_args(argv)
    loaded = {file: load_head(file) for file in options.files} or {"reference": load_head()}
    reference = next(iter(loaded.values()))
    columns = {name.rsplit("/", 1)[-1][-12:]: numbers(head, reference) for name, head in loaded.items()}
    for seed in range(options.individuals):
        columns[f"person {seed}"] = numbers(individual(reference, np.random.default_rng(seed)), reference)
    print(table(columns))
    if options.details:
        for name, found in columns.items():
            for number in found.faults():
                if number in found.details:
                    print(f"{name}: {number}: {found.details[number]}")
    return int(any(found.faults() for found in columns.values()))


def table(columns) -> str:
    """Numbers down, heads across; a star marks a number outside its limits."""
    faults = {name: found.faults() for name, found in columns.items()}
    lines = [f"{'':<28}{'limits':>12}" + "".join(f"{name:>13}" for name in columns)]
    for number, (low, high) in LIMITS.items():
        bounds = f"{'' if low is None else format(low, 'g')}..{'' if high is None else format(high, 'g')}"
        cells = ""
        for name, found in columns.items():
            value = found.values.get(number)
            text = "" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)
            cells += f"{text + ('*' if number in faults[name] else ' '):>13}"
        lines.append(f"{number:<28}{bounds:>12}{cells}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
