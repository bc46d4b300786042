# SPDX-License-Identifier: GPL-3.0-or-later
"""Is a head sound? Numbers that tests, reports and the table of heads share."""
