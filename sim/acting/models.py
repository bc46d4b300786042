# SPDX-License-Identifier: GPL-3.0-or-later
"""The models that can act a head: this product's own and those of its sources, by name and with one interface.

A model is a package of `sim` with two modules: ``model`` holds ``build_model(head)``; ``solver`` holds
``rest_state(model)`` and ``solve(model, control, state=None, *, max_iterations, tolerance)``, with `structures.Control` in
and `structures.Solution` out; one that does not iterate may have ``look(model, control)`` besides. What is built has what
`pose.control` and `posing.posed_parts` read (``muscle_names``, ``count``, ``jaw``, ``eyes``, ``rigid``), a state has
``skin`` (n, 3) mm. Packages are imported when they are asked for.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ..anatomy.head import Head
from ..errors import InputError
from ..tissue.structures import Control, Solution


@dataclass(frozen=True)
class ActingModel:
    """A model by its ``name`` on the command line, its ``title`` on a sheet, and its ``package`` under `sim`."""

    name: str
    title: str
    package: str

    def build(self, head: Head) -> Any:
        """All that is made of a head once."""
        return self._module("model").build_model(head)

    def rest_state(self, model) -> Any:
        """The head itself, at rest."""
        return self._module("solver").rest_state(model)

    def solve(self, model, control: Control, state=None, **limits) -> Solution:
        """The pose at rest; ``state`` is where to start, ``limits`` are max_iterations and tolerance (mm)."""
        return self._module("solver").solve(model, control, state, **limits)

    def look(self, model, control: Control, state, rounds: int) -> tuple[Any, bool]:
        """The pose for a slider that is being dragged: a state after ``rounds`` iterations, and whether it is at rest."""
        solver = self._module("solver")
        if hasattr(solver, "look"):  # quicker without the numbers about it
            return solver.look(model, control)
        solution = solver.solve(model, control, state, max_iterations=rounds)
        return solution.state, solution.converged

    def follower(self, model):
        """What acts under a slider instead of `look`, for a model that learns from frame to frame: has look(control, rounds);
        None for others."""
        return self._module("frames").Frames(model) if self.moves else None

    def resting(self, model, controls, rounds: int):
        """Yields the state at rest at each of ``controls``, begun where the one before ended, and whether it is one."""
        if self.moves:
            yield from self._module("frames").resting(model, controls, rounds)
            return
        state = self.rest_state(model)
        for control in controls:
            solution = self.solve(model, control, state, max_iterations=rounds)
            state = solution.state
            yield state, solution.converged

    @property
    def moves(self) -> bool:
        """Whether it can act in time, with masses that swing, and feels gravity, wind and the motion of the head."""
        return self.name == DEFAULT

    def moving(self, model, controls, dt: float):
        """Yields the state and the residual (mm) at each of ``controls``, ``dt`` seconds apart; of models that move."""
        return self._module("dynamics").moving(model, controls, dt)

    def cleared(self, model, control: Control, state):
        """The state with its skin clear of eyes, teeth and the other lip; of models that move."""
        return self._module("dynamics").cleared_of(model, control, state)

    def _module(self, name: str):
        return import_module(f"..{self.package}.{name}", __package__)


DEFAULT = "headshop"

MODELS = {
    model.name: model
    for model in (
        ActingModel("headshop", "Head Shop", "tissue"),
        ActingModel("waters", "Waters 1987", "muscle"),
        ActingModel("lee", "Lee et al. 1995", "tissue.lee1995"),
        ActingModel("kaehler", "Kähler et al. 2002", "tissue.kaehler2002"),
    )
}


def model_named(name: str = DEFAULT) -> ActingModel:
    """The model called ``name``.

    Raises
    ------
    InputError : there is none.
    """
    if name not in MODELS:
        raise InputError(f"There is no model {name!r}: choose {' or '.join(MODELS)}.")
    return MODELS[name]
