# SPDX-License-Identifier: GPL-3.0-or-later
"""Tissue and muscles of Lee, Terzopoulos and Waters 1995, section 3: springs, prisms, explicit Euler.

One file for each of the paper's ideas: `elements` (3.1, 3.2), `depth` (how thick the layers are), `stress_strain` (3.3),
`muscles` (3.4), `piecewise` (3.5), `pucker` and `puff` (5), `volume` (3.6), `skull` (3.7), `motion` (3.8, 3.9),
`constants` (3.10). `model` puts a head together and `solver` brings it to rest.

What the paper leaves open is decided here: k1, k2, the restoration and the strain of the second phase (`constants`), how
strong each muscle is (`calibration`), how long a step may be (`stability`). What it does not have at all: a mouth with
lining and teeth behind the lips (`lining`, `skull`), lids that turn on the eyeball (`posing`; its own blink "kinematically",
4.2), softer springs where there is no bone (`model`). Its constants are kept, and with them the lag of its face.
"""
