# SPDX-License-Identifier: GPL-3.0-or-later
"""One thin operator per file: parse, call one function, report."""
