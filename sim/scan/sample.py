# SPDX-License-Identifier: GPL-3.0-or-later
"""The embedded sample: a person who does not exist, known exactly, scanned by the virtual scanner.

The reference head is varied into an individual; its subdivided surface is the truth. Same seed, same bytes.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head, moved_muscles_and_jaw
from ..anatomy.storage import reference_head, write_atomically
from ..errors import InputError
from ..mesh import Mesh, vertex_normals
from ..mesh_subdivision import smoother
from ..progress import Progress, Work, portion
from ..triangle_projection import closest_on_triangles
from .individual import individual
from .noise import Noise
from .ply import write_ply
from .scanner import VirtualScanner
from .sheets import joined
from .skin_colour import Complexion, Paint, paint_skin

SEED = 8

#: Levels of subdivision: edges of the truth are then about a millimetre long.
LEVELS = 3
#: A landmark farther than this from the scan (mm) is one the scanner did not see.
SEEN = 3.0


@dataclass(frozen=True, eq=False)
class Sample:
    """A scan with everything that is true about it. All in the scan's place: mm, +Z up, face about toward -Y.

    scan : triangles with colours, raw
    landmarks : the 60, exact, on the truth
    missing : landmarks left out of the file (none: those the scanner did not see lie in mid-air)
    not_in_scan : landmarks more than `SEEN` mm from any measured point
    truth : the individual's head; ``surface`` is drawn of its skin
    surface : the smooth truth, quads of about a millimetre, with colours
    """

    scan: Mesh
    landmarks: dict[str, np.ndarray]
    missing: tuple[str, ...]
    not_in_scan: tuple[str, ...]
    truth: Head
    surface: Mesh


def make_sample(
    seed: int = SEED,
    *,
    reference: Head | None = None,
    scanner: VirtualScanner | None = None,
    levels: int = LEVELS,
) -> Work:
    """Work that returns the `Sample` of ``seed``.

    reference : the head to vary, by default the one in ``assets``; scanner : the device, set up differently;
    levels : of subdivision of the truth, fewer for a quick and coarse one
    """
    rng = np.random.default_rng([seed, 0x5EED])
    yield Progress(0.0, "Making a person")
    reference = reference or reference_head()
    person = individual(reference, rng)
    yield Progress(0.1, "Smoothing the skin")
    surface, inner, ears = _smooth(person, reference, levels, rng)
    complexion = Complexion.draw(rng)
    yield Progress(0.3, "Painting the skin")
    at = person.landmarks.on({"skin": surface.vertices[: len(person.skin.vertices)]})
    landmarks = _on_surface(at, surface)
    paint = paint_skin(surface.vertices, landmarks, inner, ears, complexion, rng)
    paint = _dressed(paint, surface.vertices, landmarks, rng)
    surface = replace(surface, colour=paint.colour)
    turn, shift = _pose(rng)
    person, surface = _posed(person, turn, shift), surface.moved(surface.vertices @ turn.T + shift)
    landmarks = {name: turn @ p + shift for name, p in landmarks.items()}
    subject, response, gloss = _with_eyes(person, surface, paint, complexion)
    scanner = scanner or VirtualScanner(target=tuple(_aim(landmarks)))
    scan = yield from portion(scanner.scan(subject, rng, response, gloss), 0.4, 0.95)
    yield Progress(0.95, "Checking the landmarks")
    distance, _ = cKDTree(scan.vertices).query(np.array(list(landmarks.values())))
    unseen = tuple(name for name, d in zip(landmarks, distance, strict=True) if d > SEEN)
    return Sample(scan, landmarks, (), unseen, person, surface)


def write_sample(sample: Sample, directory) -> list[Path]:
    """Write ``scan.ply``, ``landmarks.json`` and ``truth.ply``; the paths, in this order.

    Raises
    ------
    InputError : the folder cannot be made or written to.
    """
    directory = Path(directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory} cannot be made ({error.strerror}): choose another folder.") from error
    paths = [directory / name for name in ("scan.ply", "landmarks.json", "truth.ply")]
    comments = ("Head Shop sample, nobody's head", "millimetres, Z up, face toward -Y, +X subject left")
    document = {
        "format": "headshop-landmarks/1",
        "units": "mm",
        "landmarks": {name: np.round(p, 3).tolist() for name, p in sample.landmarks.items()},
        "missing": list(sample.missing),
        "not_in_scan": list(sample.not_in_scan),
    }
    write_ply(paths[0], sample.scan, comments=comments)
    write_atomically(paths[1], (json.dumps(document, indent=1) + "\n").encode())
    write_ply(paths[2], sample.surface, comments=comments)
    return paths


def _smooth(person, reference, levels, rng):
    """The surface drawn of the head's skin, a little uneven, and the groups inner and ears on it."""
    faces, n = person.skin.faces, len(person.skin.vertices)
    operator, quads = smoother(faces, n, levels)
    points = operator @ person.skin.vertices
    groups = reference.groups
    inner, ears = (
        np.clip(operator @ g.astype(float), 0, 1) for g in (groups["inner"], groups["ear_l"] + groups["ear_r"])
    )
    surface = Mesh(points, quads)
    normals = vertex_normals(points, surface.triangles)
    rest = operator @ reference.skin.vertices  # the unevenness of skin belongs to the skin, not to space
    relief = (0.07 * Noise(rng, 7.0)(rest) + 0.02 * Noise(rng, 2.5)(rest)) * (1 - inner)
    points = points + relief[:, None] * normals
    return Mesh(points, quads), inner, ears


def _on_surface(positions, surface):
    """Each landmark moved to the closest point of the surface."""
    triangles = surface.triangles
    names, at = list(positions), np.array(list(positions.values()))
    centres = surface.vertices[triangles].mean(axis=1)
    _, near = cKDTree(centres).query(at, k=24)
    corners = surface.vertices[triangles[near.ravel()]]
    weights, distance = closest_on_triangles(np.repeat(at, 24, axis=0), *corners.transpose(1, 0, 2))
    points = np.einsum("ij,ijk->ik", weights, corners).reshape(len(at), 24, 3)
    best = distance.reshape(len(at), 24).argmin(axis=1)
    return {name: points[k, best[k]] for k, name in enumerate(names)}


def _dressed(paint: Paint, points, landmarks, rng) -> Paint:
    """A dark collar: cloth gives back too little light to be measured well."""
    gn = landmarks["gn"]
    line = gn[2] - 62 + 0.25 * (points[:, 1] - gn[1]) + 3 * Noise(rng, 14.0)(points)
    cloth = np.clip((line - points[:, 2]) / 3, 0, 1)
    return replace(paint, response=paint.response * (1 - 0.97 * cloth), gloss=paint.gloss * (1 - cloth))


def _pose(rng):
    """People do not sit straight: a small turn (3, 3) and shift (3,) mm."""
    x, y, z = np.radians(rng.uniform(-3.5, 3.5, 3))
    c, s = np.cos([x, y, z]), np.sin([x, y, z])
    turn = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    turn = turn @ np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    turn = turn @ np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    return turn, rng.uniform(-8, 8, 3)


def _posed(head: Head, turn, shift) -> Head:
    def move(points):
        return points @ turn.T + shift

    muscles, jaw = moved_muscles_and_jaw(head, move)
    eyes = tuple(replace(e, centre=move(e.centre), gaze=turn @ e.gaze) for e in head.eyes)
    moved = head.with_vertices({name: move(mesh.vertices) for name, mesh in head.parts.items()})
    return replace(moved, muscles=muscles, jaw=jaw, eyes=eyes)


def _with_eyes(person, surface, paint, complexion):
    """Skin and eyeballs as one mesh for the scanner, with response and gloss per vertex; corneas are too clear."""
    meshes, response, gloss = [Mesh.from_triangles(surface.vertices, surface.triangles, colour=surface.colour)], [], []
    response.append(paint.response)
    gloss.append(paint.gloss)
    # sclera, iris, pupil: colour, response, gloss
    looks = (((0.83, 0.79, 0.76), 0.8, 0.8), (complexion.iris, 2.2, 0.6), ((0.01, 0.01, 0.01), 5.0, 0.6))
    for part in ("eye_l", "eye_r"):
        mesh = person.parts[part]
        for number, (colour, back, shine) in enumerate(looks):
            faces = mesh.faces[mesh.material == number]
            if not len(faces):
                continue
            used, local = np.unique(faces[faces >= 0], return_inverse=True)
            own = np.full(faces.shape, -1, dtype=np.int32)
            own[faces >= 0] = local.ravel()
            piece = Mesh(mesh.vertices[used], own)
            srgb = np.asarray(colour) if number == 0 else np.sqrt(np.asarray(colour))
            colours = np.tile(np.float32(srgb), (len(used), 1))
            meshes.append(Mesh.from_triangles(piece.vertices, piece.triangles, colour=colours))
            response.append(np.full(len(used), back))
            gloss.append(np.full(len(used), shine))
    return joined(meshes), np.concatenate(response), np.concatenate(gloss)


def _aim(landmarks):
    """Where the cameras look: between the ears and the nose, at the height of the nose's base."""
    ears = (landmarks["t_l"] + landmarks["t_r"]) / 2
    return np.array([ears[0], (ears[1] + landmarks["prn"][1]) / 2, landmarks["sn"][2]])
