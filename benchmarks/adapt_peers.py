# SPDX-License-Identifier: GPL-3.0-or-later
"""The peers: non-rigid ICP of trimesh, after Amberg, Romdhani and Vetter 2007 and after Sumner and Popovic 2004.

They get the skin's outer part as it is drawn (its own vertices, or subdivided once), laid on the landmarks by the
best similarity; the same landmarks; the same scan. Tried are their defaults, other thresholds of the distance at
which a match counts (their main trouble on partial scans; in units of the template's size), vertices instead of
faces, and an extra, softer step at the end.
"""

import time

import numpy as np

from headshop.sim.adapt.thin_plate_spline import similarity
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.triangle_projection import Triangles

AMBERG = [[0.01, 10, 0.5, 10], [0.02, 5, 0.5, 10], [0.03, 2.5, 0.5, 10], [0.01, 0, 0.0, 10]]
SUMNER = [[2, 0.001, 0, 10, 0], [5, 0.01, 0.0001, 5, 0], [10, 0.1, 0.001, 2.5, 0], [10, 1, 0.01, 0, 0]]
SETTINGS = {
    "nricp_amberg": {
        "defaults": {},
        "threshold 0.03": {"distance_threshold": 0.03},
        "threshold 0.01": {"distance_threshold": 0.01},
        "softer end": {"distance_threshold": 0.03, "steps": [*AMBERG, [0.003, 0, 0.0, 10]]},
        "vertices": {"distance_threshold": 0.03, "use_faces": False, "neighbors_count": 8},
    },
    "nricp_sumner": {
        "defaults": {},
        "threshold 0.03": {"distance_threshold": 0.03},
        "threshold 0.01": {"distance_threshold": 0.01},
        "vertices": {"distance_threshold": 0.03, "use_faces": False, "neighbors_count": 8},
    },
}


class Template:
    """The outer part of the skin (t, 3) ``triangles`` over ``vertices`` (n, 3) mm, and the landmarks on it."""

    def __init__(self, reference, drawn_vertices):
        inner = reference.groups["inner"] > 0.5
        self.vertices = drawn_vertices
        triangles = reference.skin.triangles
        self.triangles = triangles[~inner[triangles].any(axis=1)]
        self.used, local = np.unique(self.triangles, return_inverse=True)
        self.local = local.reshape(-1, 3)
        self.marks = reference.landmarks.on({"skin": drawn_vertices})
        rows = {tuple(sorted(t)): k for k, t in enumerate(self.triangles.tolist())}
        at, weights, self.names = [], [], []
        points = reference.landmarks
        for name, part, corners, weight in zip(points.names, points.part, points.corners, points.weights, strict=True):
            row = rows.get(tuple(sorted(corners.tolist())))
            if part == "skin" and row is not None:
                order = [corners.tolist().index(v) for v in self.triangles[row]]
                at.append(row)
                weights.append(weight[order])
                self.names.append(name)
        self.places = np.array(at), np.array(weights)

    def seen_triangles(self, within=None) -> np.ndarray:
        """(t, 3) of the surface; only those between the vertices ``within`` (n,) bool if given."""
        return self.triangles if within is None else self.triangles[within[self.triangles].all(axis=1)]

    def registered(self, peer: str, settings: dict, subject):
        """Vertices (n, 3) mm of the template registered by ``peer``, and the seconds that took, elapsed and of CPU."""
        import trimesh

        goal = np.array([subject.landmarks[name] for name in self.names])
        matrix, shift = similarity(np.array([self.marks[name] for name in self.names]), goal)
        start = self.vertices @ matrix.T + shift
        source = trimesh.Trimesh(start[self.used], self.local, process=False)
        target = trimesh.Trimesh(subject.scan.vertices, subject.scan.triangles, process=False)
        begin, used = time.perf_counter(), time.process_time()
        moved = getattr(trimesh.registration, peer)(source, target, self.places, goal, **settings)
        seconds = {"seconds": time.perf_counter() - begin, "cpu": time.process_time() - used}
        out = start.copy()
        out[self.used] = moved
        return out, seconds


class Finer(Template):
    """A ``template`` subdivided once: as fine as the surface that is drawn. Its first n vertices are the template's own.

    rows (k, n) : sparse, its vertices from those of the cage
    """

    def __init__(self, template: Template, reference):
        faces, n = reference.skin.faces, len(reference.skin.vertices)
        self.rows, quads = smoother(faces, n)
        self.vertices = self.rows @ reference.skin.vertices
        self._corners = faces[quads.max(axis=1) - (len(self.vertices) - len(faces))].repeat(2, axis=0)
        self.triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        seen = self._within(reference.groups["inner"] <= 0.5)
        self.triangles, self._corners = self.triangles[seen], self._corners[seen]
        self.used, local = np.unique(self.triangles, return_inverse=True)
        self.local = local.reshape(-1, 3)
        self.marks, self.names = template.marks, template.names
        surface = Triangles(self.vertices[self.triangles])
        count = len(self.triangles)
        at, weights = [], []
        for name in self.names:
            share, far = surface.closest(self.marks[name][None], np.zeros(count, dtype=int), np.arange(count))
            at.append(far.argmin())
            weights.append(share[at[-1]])
        self.places = np.array(at), np.array(weights)

    def _within(self, chosen):
        """(t,) bool: triangles of faces of the cage all of whose corners are ``chosen`` (n,) bool."""
        return np.where(self._corners >= 0, chosen[self._corners], True).all(axis=1)

    def seen_triangles(self, within=None) -> np.ndarray:
        """As of the template; ``within`` (n,) bool is of the cage's vertices."""
        return self.triangles if within is None else self.triangles[self._within(within)]
