# SPDX-License-Identifier: GPL-3.0-or-later
"""The tissue following a moving control frame by frame, contact included: a few steps of the solver each.

What the quasi-Newton steps have learnt of the energy's curvature stays nearly true from one frame to the next, so it is
kept. A frame starts where jaw and lids carry the last one, and goes on by what the frames before moved for the like
change of the control.
"""

import numpy as np

from .clearing import cleared, way_out
from .curvature import Curvature
from .drawn_contact import CLEAR
from .drawn_samples import planes_of
from .energy import Pose, find_contacts, pose_of
from .flesh import flesh_contacts
from .forces import Landscape
from .lid_meeting import met
from .nearby import Nearby
from .single import single
from .solver import descend, factorised, minimise, rest_state
from .structures import Control, Model, State

#: Steps that a frame is given, and the mm of a step at which fewer do.
STEPS, TOLERANCE = 7, 0.05
#: The mm of a step at which a pose counts as settled.
SETTLED = 0.01
#: The last step is taken without a look at the energy behind it if no node moves farther, mm.
_TRUST = 0.3
#: Rounds of moving the skin clear of what is left at the end of a frame.
_ROUNDS = 5
#: Frames before that foretell the next, how far they may not be trusted (ridge, a share of their changes), and how much
#: of their motion a frame may begin with (factor, mm).
_PAST, _RIDGE, _MOST, _FAR = 2, 0.1, 1.5, 3.0
#: mm on the skin, about, that jaw, lids, gaze, lips, cheeks and the seal of the lips move at 1 (rad): what counts as a
#: like change.
_JAW, _LIDS, _GAZE, _LIPS, _CHEEKS, _SEAL = (15.0, 5.0, 5.0), 3.0, 3.0, 3.0, 6.0, 3.0


class Frames:
    """Follows controls with a model, one frame a call; starts at rest. Same calls, same results.

    state : the `State` of the last frame; residual : mm, the step that was left of it; converged : whether that is no
    more than was asked for; iterations : steps that it took
    """

    def __init__(self, model: Model):
        self.model = model
        self.state = rest_state(model)
        self.residual, self.iterations, self.converged = 0.0, 0, True
        self._curvature, self._nearby = Curvature(), Nearby()
        self._looks = self._lid_goal = None
        self._at = self._goal = self._asked = None  # where nodes were, free ones were carried, and the control as mm
        self._off = self._change = None  # by how much they lay elsewhere, and the last change of the control
        self._past = []

    def follow(self, control: Control, steps: int = STEPS, tolerance: float = TOLERANCE) -> State:
        """The `State` at rest under ``control``, as near as so many ``steps`` of the solver come, or as a step of no more
        than ``tolerance`` mm leaves it."""
        model = self.model
        pose = self._pose = self._posed(control)
        start = self._start(pose, _millimetres(model, control))
        positions, self.residual, self.iterations, planes = self._descended(pose, start, steps, tolerance)
        self.converged = self.residual <= tolerance
        self._at = positions
        positions = self._clear(planes, met(model, pose.shut, positions))
        self.state = State(positions, np.zeros_like(positions))
        return self.state

    def _clear(self, planes, positions):
        """``positions`` (3 n, 3) mm out of the ``planes`` of contact, and flesh that is drawn too thin as thick as may be."""
        model = self.model
        n, free = model.count, model.layers.free[: model.count]
        kept = CLEAR  # contact keeps a little off: what is nearer has not gone through
        for _ in range(_ROUNDS):
            out = way_out(planes, positions, free, kept)
            if out is not None:
                positions = positions.copy()
                positions[:n] += out
            elif kept == 0:
                break
            planes, kept = planes_of([flesh_contacts(model.drawn.flesh, positions[:n])], n), 0.0
        return positions

    def _descended(self, pose: Pose, start, steps, tolerance):
        """Positions (3 n, 3) mm, the mm of the last step, the steps, and the contacts, found once for a few steps."""
        model, factor = self.model, factorised(self.model)
        if steps > STEPS:
            positions, _, residual, done, planes = minimise(
                lambda planes: Landscape(single(model), pose, planes),
                lambda x: find_contacts(model, pose, x),
                factor,
                start,
                steps,
                tolerance,
                self._curvature,
                _TRUST,
            )
            return positions, residual, done, planes
        planes = find_contacts(model, pose, start, self._nearby)
        at = Landscape(single(model), pose, planes)
        q, _, residual, done = descend(at, factor, at.free(start), self._curvature, steps, tolerance, _TRUST)
        return at.positions(q), residual, done, planes

    def cleared(self) -> State:
        """The last frame with the drawn skin clear of eyeballs, teeth and the other lip whatever contact left, as `solve`
        does it: it takes longer than a frame."""
        positions = cleared(self.model, self._pose, self._at)
        return State(positions, np.zeros_like(positions))

    def look(self, control: Control, steps: int) -> tuple[State, bool]:
        """For a slider: the state after at most so many ``steps``, and whether it is at rest. Few are a look in passing, more
        bring it to rest."""
        state = self.follow(control, steps, TOLERANCE if steps <= STEPS else SETTLED)
        settled = steps > STEPS and self.converged
        return (self.cleared() if settled else state), settled

    def _posed(self, control: Control) -> Pose:
        """`pose_of` the control; where the lids go is kept while neither they nor the eyes move."""
        looks = np.concatenate([np.ravel(x) for x in (control.lids, control.gaze, control.eyes)]).tobytes()
        if looks != self._looks:
            self._looks, self._lid_goal = looks, None
        pose = pose_of(self.model, control, self._lid_goal)
        self._lid_goal = pose.lid_goal
        return pose

    def _start(self, pose: Pose, asked: np.ndarray) -> np.ndarray:
        """(3 n, 3) mm: where the nodes are likely to come to rest, bone and what is not free in its place."""
        fixed = self.model.cache["matrix"]
        free, row = fixed["free"], fixed["row"][pose.lid_node]
        goal = pose.reference.take(free, axis=0)
        moved = row < len(free)
        goal[row[moved]] = pose.lid_goal[moved]
        begin = goal
        if self._at is not None:
            off = self._at.take(free, axis=0) - self._goal
            change = asked - self._asked
            if self._off is not None:
                self._past = [*self._past, (self._change, off - self._off)][-_PAST:]
            begin = goal + off + self._foretold(change)
            self._off, self._change = off, change
        self._goal, self._asked = goal, asked
        start = pose.reference.copy()
        start[free] = begin
        return start

    def _foretold(self, change: np.ndarray):
        """(m, 3) mm: what the last frames moved for the part of their changes that ``change`` is made of."""
        if not self._past:
            return 0.0
        changes = np.array([one for one, _ in self._past])
        products = changes @ changes.T
        scale = np.trace(products)
        if scale < 1e-9:
            return 0.0
        ridge = _RIDGE * scale / len(changes) * np.eye(len(changes))
        share = np.clip(np.linalg.solve(products + ridge, changes @ change), -_MOST, _MOST)
        moved = sum(part * motion for part, (_, motion) in zip(share, self._past, strict=True))
        farthest = np.sqrt(np.einsum("ij,ij->i", moved, moved).max(initial=0.0))
        return moved * min(1.0, _FAR / max(farthest, _FAR))


def resting(model: Model, controls, steps: int):
    """Yields the `State` at rest at each of ``controls``, within at most so many ``steps``, and whether it is at rest."""
    frames = Frames(model)
    for control in controls:
        frames.follow(control, steps, SETTLED)
        yield frames.cleared(), frames.converged


def _millimetres(model: Model, control: Control) -> np.ndarray:
    """(k,) what a control asks, in mm on the skin."""
    return np.concatenate(
        [
            np.clip(control.activations, 0, 1) * model.muscles.excursion,
            np.multiply(control.jaw, _JAW),
            _LIDS * np.ravel(control.lids),
            _GAZE * np.ravel(control.gaze),
            _GAZE * np.ravel(control.eyes),
            _LIPS * np.ravel(control.lips),
            [_CHEEKS * control.cheeks, _SEAL * control.seal],
        ]
    )
