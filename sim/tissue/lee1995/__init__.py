# SPDX-License-Identifier: GPL-3.0-or-later
"""Tissue and muscles exactly as Lee, Terzopoulos and Waters 1995, section 3, have them: springs, prisms, explicit Euler.

One file for each of the paper's ideas: `elements` (3.1, 3.2), `depth` (how thick the layers are), `stress_strain` (3.3),
`muscles` (3.4), `piecewise` (3.5), `pucker` and `puff` (5), `volume` (3.6), `skull` (3.7), `motion` (3.8, 3.9),
`constants` (3.10), `stability`, `calibration`, `lining`; `model` puts a head together and `solver` brings it to rest.
"""
