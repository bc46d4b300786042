# SPDX-License-Identifier: GPL-3.0-or-later
"""Acting: poses, expressions and performances in terms of muscles."""
