# SPDX-License-Identifier: GPL-3.0-or-later
"""All forces of a pose as the gradient of one energy (`energy` says of what it is made) over the nodes that are free."""

import numpy as np

from .axes import per_axis
from .energy import Pose
from .planes import Planes, contact_pushes, row_energy
from .seal import seal_energy
from .springs import spring_forces
from .structures import Model
from .volume import volume_forces


class Landscape:
    """The energy of ``pose`` with the contacts ``planes`` over the free nodes' positions q (3, m) mm, axis by axis.

    Nodes that are not free stay where the pose has them. What the same pose and contacts always need is made once.
    Springs, volume and restoration, which take the longest, are as precise as the model's tables (`single`).
    """

    def __init__(self, model: Model, pose: Pose, planes: Planes):
        self.model, self.pose, self.planes = model, pose, planes
        fixed = model.cache["matrix"]
        self._free, self._row = fixed["free"], fixed["row"]
        self._kind = model.springs.rest.dtype
        self._around = np.ascontiguousarray(pose.reference.T)
        self._reference = self._around.take(self._free, axis=1, mode="clip")
        self._pull = np.ascontiguousarray(pose.pull.T)
        self._begun = np.einsum("ij,ij->i", pose.reference[pose.node], pose.pull)
        self._goal = np.ascontiguousarray(pose.lid_goal.T)
        self._held = self._row[np.concatenate([pose.node, pose.lid_node])]
        self._force = np.empty((3, len(model.springs.rest) + model.prisms.size), self._kind)

    def free(self, positions) -> np.ndarray:
        """(3, m) mm: the free nodes of ``positions`` (3 n, 3)."""
        return positions.T.take(self._free, axis=1, mode="clip")

    def positions(self, q) -> np.ndarray:
        """(3 n, 3) mm: all nodes, the free ones at ``q``."""
        out = self.pose.reference.copy()
        out[self._free] = q.T
        return out

    def __call__(self, q) -> tuple[float, np.ndarray]:
        """Energy and its gradient (3, m) at ``q``."""
        model, p = self.model, self.model.parameters
        fixed = model.cache["matrix"]
        x = self._around.copy()
        x[:, self._free] = q
        near = x.astype(self._kind, copy=False)
        springs, force = len(model.springs.rest), self._force
        energy = spring_forces(model.springs, near, force[:, :springs])[0]
        prisms = model.prisms, model.prism_volume
        energy += volume_forces(near, *prisms, p.volume, p.crushed, p.hardening, force[:, springs:])[0]
        gradient = per_axis(fixed["gather"], force)
        off = (q - self._reference).astype(self._kind, copy=False)
        restoring = per_axis(fixed["quadratic"], off)
        energy += 0.5 * float(np.vdot(restoring, off))
        gradient += restoring
        if self.pose.load is not None:
            load = self.pose.load.take(self._free, axis=1, mode="clip")
            energy -= float(np.vdot(load, off))
            gradient -= load
        spent, pulled = self._muscles(x)
        held, lids = self._lids(x)
        self._add(gradient, self._held, np.concatenate([pulled, lids], axis=1))
        return energy + spent + held + self._seal(x, gradient) + self._contacts(x, gradient), gradient

    def _muscles(self, x):
        """Force push (1 - progress / reach), spent at reach; contraction is progress along the fibre's direction. The energy,
        and its gradient at each entry (3, e)."""
        pose = self.pose
        progress = np.einsum("ij,ij->j", x.take(pose.node, axis=1, mode="clip"), self._pull) - self._begun
        left = np.maximum(1 - progress / pose.reach, 0)
        return -0.5 * float((pose.push * pose.reach) @ (1 - left**2)), -pose.push * left * self._pull

    def _lids(self, x):
        pose = self.pose
        off = x.take(pose.lid_node, axis=1, mode="clip") - self._goal
        pulled = pose.lid_stiffness * off
        return 0.5 * float(np.vdot(pulled, off)), pulled

    def _seal(self, x, gradient):
        seal, pose = self.model.seal, self.pose
        if not pose.seal:
            return 0.0
        energy, pulled = seal_energy(seal, pose.seal * self.model.parameters.seal, x.T)
        self._add(gradient, self._row[seal.lower], pulled.T)
        self._add(gradient, self._row[seal.upper], -pulled.T)
        return energy

    def _contacts(self, x, gradient):
        planes, p = self.planes, self.model.parameters
        stiffness = p.contact * p.epidermis
        energy, node, push = contact_pushes(planes, x.T, stiffness)
        if len(node):
            self._add(gradient, self._row[node], push.T)
        if planes.rows is None:
            return energy
        skin = planes.rows.shape[1] // 3
        more, pushed = row_energy(planes, x[:, :skin].T, stiffness)
        if more:
            column = self._free[: np.searchsorted(self._free, skin)]  # in order: epidermis first
            gradient[:, : len(column)] += pushed.T.take(column, axis=1, mode="clip")
        return energy + more

    @staticmethod
    def _add(gradient, row, values):
        """Add values (3, k) to the columns ``row`` (k,) of ``gradient`` (3, m); those of m are not free."""
        count = gradient.shape[1]
        for axis in range(3):
            gradient[axis] += np.bincount(row, values[axis], minlength=count + 1)[:count]


def energy_gradient(model: Model, pose: Pose, planes: Planes, positions) -> tuple[float, np.ndarray]:
    """Energy and its gradient over the free nodes (m, 3); ``positions`` (3 n, 3), as the pose has them but for those."""
    at = Landscape(model, pose, planes)
    energy, gradient = at(at.free(positions))
    return energy, gradient.T
