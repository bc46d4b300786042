# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators that bake a set of poses share."""

from . import active, polls
from .jobs import Job


class BakeJob(Job):
    """Mixin of the bakes: simulate every pose of ``poses`` and keep each as a shape key."""

    panel = "bake"
    poses = ""

    @classmethod
    def poll(cls, context):
        """Needs a head and the simulation."""
        return polls.library(cls, "scipy") and polls.own_head(cls, context) and polls.object_mode(cls, context)

    def work(self, context):
        """Simulate and write."""
        from .baking import bake

        return (yield from bake(active.skin(context), self.poses))

    def finish(self, context, result):
        """Say what came out."""
        from .baking import summary

        return summary(result)
