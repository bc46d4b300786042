# SPDX-License-Identifier: GPL-3.0-or-later
"""Subjects to adapt to: people made by the sample's generator, in correspondence with the template, scanned whole or in
part; scans of others from a folder; and surfaces of any number of triangles."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.anatomy.head import Head
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.ply import read_ply
from headshop.sim.scan.sample import make_sample

LEVELS = 2  # of subdivision: about 80,000 triangles, as many as the partial scans have


@dataclass(frozen=True, eq=False)
class Subject:
    """scan : clean, mm; landmarks : name -> mm; truth (n, 3) mm : where each vertex of the template belongs, or None; skin :
    the person's own, which was scanned, or None."""

    name: str
    kind: str
    scan: Mesh
    landmarks: dict[str, np.ndarray]
    truth: np.ndarray | None
    skin: Mesh | None = None


def own_subjects(reference: Head, seed: int) -> list[Subject]:
    """One person twice: the whole surface without noise, and what the virtual scanner sees of it."""
    sample = finish(make_sample(seed, levels=LEVELS))
    seen = seen_quads(reference, LEVELS)
    surface = Mesh(sample.surface.vertices, sample.surface.faces[seen])
    truth = sample.surface.vertices[: len(reference.skin.vertices)]
    whole = clean_scan(Mesh.from_triangles(surface.vertices, surface.triangles))[0]
    part = clean_scan(sample.scan)[0]
    return [
        Subject(f"person {seed}", "whole", whole, sample.landmarks, truth, whole),
        Subject(f"person {seed}", "partial", part, sample.landmarks, truth, whole),
    ]


def seen_quads(reference: Head, levels: int) -> np.ndarray:
    """(q,) bool: the faces of the subdivided skin that a scanner could see."""
    faces = reference.skin.faces
    inner = reference.groups["inner"] > 0.5
    quads = (np.where(faces >= 0, 4 ** (levels - 1) * np.where(faces[:, 3:] >= 0, 4, 3), 0)).max(axis=1)
    return np.repeat(~np.where(faces >= 0, inner[faces], False).any(axis=1), quads)


def folder_subjects(folder) -> list[Subject]:
    """Scans NAME_scan.ply with landmarks NAME_truth.json, and whole surfaces NAME_truth.ply, in ``folder``."""
    found = []
    for marks in sorted(Path(folder).glob("*_truth.json")):
        name = marks.name.removesuffix("_truth.json")
        landmarks = read_landmarks(marks)
        for kind, end in (("whole", "truth"), ("partial", "scan")):
            path = marks.with_name(f"{name}_{end}.ply")
            if path.exists():
                found.append(Subject(name, kind, clean_scan(read_ply(path))[0], landmarks, None))
    return found


def surface_of(reference: Head, count: int, seed: int = 1):
    """A random person's skin in ``count`` triangles, as a clean `Mesh` with a scanner's noise, and its landmarks."""
    rng = np.random.default_rng(seed)
    skin = reference.skin
    cage = skin.vertices + draw_field(reference.landmark_positions(), rng)(skin.vertices)
    level = next((k for k in (4, 3, 2, 1) if 2 * seen_quads(reference, k).sum() <= count), 1)
    operator, quads = smoother(skin.faces, len(cage), level)
    points = operator @ cage
    landmarks = reference.landmarks.on({"skin": points[: len(cage)]})
    quads = quads[seen_quads(reference, level)]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int64)
    while len(triangles) < count - 1:  # a triangle parted at its middle makes three
        pick = rng.permutation(len(triangles))[: (count - len(triangles)) // 2]
        a, b, c = triangles[pick].T
        new = len(points) + np.arange(len(pick))
        points = np.concatenate([points, points[triangles[pick]].mean(axis=1)])
        parts = [np.stack(x, axis=1) for x in ((a, b, new), (b, c, new), (c, a, new))]
        triangles = np.concatenate([np.delete(triangles, pick, axis=0), *parts])
    points = points + rng.normal(0, 0.02, points.shape)
    return clean_scan(Mesh.from_triangles(points, triangles))[0], {n: landmarks[n] for n in reference.landmarks.names}
