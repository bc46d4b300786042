# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception that means: the input is at fault, and here is what to do."""


class InputError(ValueError):
    """Bad input. The message is one sentence for the user: what, where, what to do.

    The command line prints it on stderr and exits with status 2; operators pass it to ``self.report``.
    """
