# SPDX-License-Identifier: GPL-3.0-or-later
"""What the steps of a descent have taught of the energy's curvature (L-BFGS), in its compact form.

The two loops of Nocedal and Wright 2006, algorithm 7.4, pass over every pair by itself; the same inverse as one product of
tall matrices (Byrd, Nocedal and Schnabel 1994, Math. Program. 63, theorem 2.2) passes over the memory four times in all.

The tables are in single precision: they only say which way to go, not where the rest is.

The matrix A that a descent steps by holds a spring as firmly across as along, which is too firm for most steps and not
firm enough where surfaces touch. So it counts by what it was off by in the steps made: the median, over the pairs, of the
ratio of 7.20 in Nocedal and Wright, in the norm of A^-1.
"""

import numpy as np


class Curvature:
    """The last steps s, changes y of the gradient along them, and A^-1 y, with A the matrix that a descent steps by."""

    def __init__(self, memory: int = 20):
        self._memory = memory
        self.clear()

    def __len__(self):
        return len(self._order)

    def clear(self):
        """Forget all."""
        self._order = []  # rows of the tables, from the oldest to the newest
        self._next = 0

    def add(self, step, change, solved):
        """Remember a ``step``, the ``change`` of the gradient and A^-1 times that, all of one shape; if it curves upwards."""
        if not float(np.vdot(step, change)) > 1e-10:
            return
        if not self._order:
            size = self._memory
            self._steps, self._changes, self._solved = np.zeros((3, size, step.size), np.float32)
            self._across, self._inner = np.zeros((2, size, size))
        at = self._next
        if len(self._order) == self._memory:
            self._order.remove(at)
        self._order.append(at)
        self._next = (at + 1) % self._memory
        self._steps[at], self._changes[at], self._solved[at] = step.ravel(), change.ravel(), solved.ravel()
        self._across[:, at] = self._steps @ self._changes[at]
        self._inner[at] = self._changes @ self._solved[at]
        self._inner[:, at] = self._inner[at]
        k = len(self._order)
        rows = np.array(self._order)
        order = np.ix_(rows, rows)
        upper = np.triu(self._across[order])
        self._root = np.zeros((k, k))
        self._root[order] = np.linalg.inv(upper)
        along = np.diag(self._across)[:k]
        self._scale = float(np.median(along / np.diag(self._inner)[:k]))
        self._middle = self._scale * self._inner[:k, :k] + np.diag(along)

    def applied(self, gradient, solved):
        """The inverse curvature times ``gradient``, from A^-1 times that, ``solved``; both of one shape."""
        k = len(self._order)
        if not k:
            return solved
        steps, tail = self._steps[:k], self._solved[:k]
        flat = gradient.ravel().astype(np.float32)
        along = self._root @ (steps @ flat)
        back = self._root.T @ (self._middle @ along - self._scale * (tail @ flat))
        learnt = back.astype(np.float32) @ steps - (self._scale * along).astype(np.float32) @ tail
        return self._scale * solved + learnt.reshape(solved.shape)
