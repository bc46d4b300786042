# SPDX-License-Identifier: GPL-3.0-or-later
"""The animation model of Kähler, Haber, Yamauchi and Seidel 2002, "Head shop: Generating animated head models with
anatomical structure", sections 3 and 4: skin as a mass-spring mesh on muscles, skull and jaw.

What comes from where. The 2002 paper names the parts and sends the reader for their mechanics to its companion, Kähler,
Haber and Seidel 2001, "Geometry-based muscle modeling for facial animation" (Graphics Interface). From 2002: skin
vertices attached once and for all to muscles and bone, muscles to the mandible; the spring mesh along the middle axes
with common nodes of merged muscles; the orbicularis oris in two halves whose centres move along a line; volume and skull
as forces in the equations of motion; the Verlet leapfrog. From 2001, as 2002 sums it up and by recollection, not word by
word: fibres as control polygons that shorten along themselves or toward a point, the ellipsoid on each segment and its
bulge, springs doubled by mirrored ones outside the skin. Neither prints constants that would fit another mesh: those in
`parameters` are the ratios of Lee et al. 1995, 3.10, or our own and say so. Lids, eyeballs and teeth, which the paper's
physics leaves out, are those of the other solvers here.
"""
