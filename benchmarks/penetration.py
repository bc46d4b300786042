# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep surfaces reach into each other in the ARKit shapes and in random pairs of them, and what volume does.

    python benchmarks/penetration.py [--pairs 300] [--seed 0] [--levels 2]

Each pose is solved from rest on the reference head, as a bake does it; a pair is both poses' channels at once. Then the skin
is drawn, subdivided ``--levels`` times and on the limit surface, and every vertex of it is measured against the meshes
themselves, not where and how the solver looks: lids against the eyeball with its cornea, lips and the lining of lips and cheeks
against the crowns of the teeth (inside or not by winding number), each lip against the triangles of the other, fascia
against skull and mandible. What is beyond the depth at rest counts. Gums are left to `report.json`: the lining has grown
onto them. Closed lids: the largest gap between the lids' drawn edges at a blink. Lips: the least gap between them on /p b m/.
Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.arkit import over, poses
from headshop.sim.acting.pose import Pose, combined, control
from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.inside import inside
from headshop.sim.anatomy.storage import load_head
from headshop.sim.anatomy.teeth import crowns
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.tissue.energy import pose_of
from headshop.sim.tissue.eye_surface import eyeball_radius
from headshop.sim.tissue.gingiva import attached
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import rest_state, solve

LIMIT = 0.1
NAMES = ("lip_lip", "lid_eyeball", "skin_teeth", "fascia_skull")
#: Lips pressed together as for /p b m/, with the jaw as it then is.
CLOSED = Pose({"orbicularis_oris_upper": 0.35, "orbicularis_oris_lower": 0.35}, jaw_open=0.03)


class Ruler:
    """Depths (k,) mm of points in what they should stay out of, by pair of surfaces."""

    def __init__(self, head, model, levels):
        self.model, n = model, model.count
        self.rows, quads = smoother(head.skin.faces, n, levels)
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        group = {k: self.rows @ np.asarray(head.groups[k], float) for k in ("lip_upper", "lip_lower", "mouth_bag")}
        self.lips = [np.flatnonzero(group[k] > 0.3) for k in ("lip_upper", "lip_lower")]
        self.patches = [triangles[(group[k] > 0.3)[triangles].all(axis=1)] for k in ("lip_upper", "lip_lower")]
        free = self.rows @ attached(head)[0] < 0.3
        self.mouth = np.flatnonzero((np.max(list(group.values()), axis=0) > 0.05) & free)
        self.teeth = {}
        for part in ("teeth_upper", "teeth_lower"):
            mesh = head.parts[part]
            enamel = np.zeros(len(mesh.vertices), bool)
            used = mesh.faces[mesh.material == 0]
            enamel[used[used >= 0]] = True
            crown = mesh.triangles[(enamel & crowns(mesh))[mesh.triangles].all(axis=1)]
            self.teeth[part] = mesh.vertices, crown, mesh.triangles[enamel[mesh.triangles].all(axis=1)]
        bony = model.layers.bony & model.layers.free[:n]
        self.bones = {}
        for part, low in (("skull", False), ("mandible", True)):
            mesh = head.parts[part]
            column = np.flatnonzero(bony & ((model.layers.mandible > 0.5) == low))
            self.bones[part] = column, Surface(mesh.vertices, mesh.triangles), mesh
        self.rest = None
        self.rest = self.depths(rest_state(model).positions, pose_of(model, control(model, Pose())))

    def depths(self, positions, pose):
        """Pair -> list of depths (k,), as far as they are known; less than nothing is apart."""
        n = self.model.count
        skin = self.rows @ positions[:n]
        out = {name: [] for name in NAMES}
        for own, other in ((0, 1), (1, 0)):
            out["lip_lip"].append(self._behind(skin, self.lips[own], self.patches[other]))
        for lids in self.model.lids:
            away = np.linalg.norm(skin - lids.eye.centre, axis=1)
            depth = np.full(len(skin), -1.0)
            near = np.flatnonzero(away < lids.eye.radius + 3)
            depth[near] = eyeball_radius(lids, skin[near], pose.gaze_of(lids.side)) - away[near]
            out["lid_eyeball"].append(depth)
        for part, (vertices, crown, whole) in self.teeth.items():
            if part == "teeth_lower":
                vertices = vertices @ pose.rotation.T + pose.translation
            out["skin_teeth"].append(self._within(skin, self.mouth, vertices, crown, whole))
        for part, (column, surface, mesh) in self.bones.items():
            points = positions[n + column]
            if part == "mandible":
                points = (points - pose.translation) @ pose.rotation
            found = surface.closest(points, 8.0)
            sign = np.where(inside(points, mesh.vertices, mesh.triangles), 1, -1)
            out["fascia_skull"].append(np.where(found.found, sign * found.distance, -1.0))
        return out

    @staticmethod
    def _behind(skin, rows, patch):
        used, local = np.unique(patch, return_inverse=True)
        found = Surface(skin[used], local.reshape(patch.shape)).closest(skin[rows], 4.0)
        depth = np.full(len(rows), -1.0)
        at = np.flatnonzero(found.found & ~found.border)
        rise = np.einsum("ij,ij->i", skin[rows[at]] - found.points[at], found.normals[at])
        plain = np.abs(rise) > 0.9 * found.distance[at]  # round the corner of the mouth lips lie beside each other
        depth[at[plain]] = -rise[plain]
        return depth

    @staticmethod
    def _within(skin, rows, vertices, crown, whole):
        low, high = vertices[crown].min(axis=(0, 1)), vertices[crown].max(axis=(0, 1))
        depth = np.full(len(rows), -1.0)
        at = np.flatnonzero(((skin[rows] > low) & (skin[rows] < high)).all(axis=1))
        if len(at):
            lost = at[inside(skin[rows[at]], vertices, whole)]
            if len(lost):
                depth[lost] = Surface(vertices, crown).closest(skin[rows[lost]]).distance
        return depth

    def __call__(self, positions, pose):
        """Pair -> mm of the deepest, beyond rest."""
        now = self.depths(positions, pose)
        return {
            name: max(
                float((d - np.maximum(r, 0)).max(initial=0.0)) for d, r in zip(now[name], self.rest[name], strict=True)
            )
            for name in NAMES
        }

    def lip_gap(self, positions):
        """mm between the lips where they are nearest to each other."""
        skin = self.rows @ positions[: self.model.count]
        surface = Surface(skin, self.patches[1])
        return float(surface.closest(skin[self.lips[0]]).distance.min())


def lid_gap(model) -> float:
    """mm: the largest gap that a blink leaves between the drawn edges of the lids; 0 where they overlap all along."""
    skin = solve(model, control(model, Pose(blink_l=1.0, blink_r=1.0)), max_iterations=200).state.skin
    between = [
        lids.eye.radius * lids.edge.gap(skin, lids.upper, lids.within)[lids.opening > 0.02].max() for lids in model.lids
    ]
    return max(0.0, *map(float, between))


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, default=300, help="random pairs of shapes")
    parser.add_argument("--seed", type=int, default=0, help="which pairs")
    parser.add_argument("--levels", type=int, default=2, help="subdivisions of the skin that is measured")
    options = parser.parse_args()
    head = load_head()
    model = build_model(head)
    ruler = Ruler(head, model, options.levels)
    shapes = poses()
    for name, base in over().items():
        shapes[name] = combined(shapes[name], shapes[base])
    names = list(shapes)
    every = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :]]
    chosen = np.random.default_rng(options.seed).permutation(len(every))[: options.pairs]
    runs = [(name, shapes[name]) for name in names]
    runs += [("+".join(every[k]), combined(*(shapes[name] for name in every[k]))) for k in sorted(chosen)]
    rows, begin = [], time.perf_counter()
    for name, pose in runs:
        asked = control(model, pose)
        solution = solve(model, asked, max_iterations=200)
        depth = ruler(solution.state.positions, pose_of(model, asked))
        found = solution.diagnostics
        rows.append(
            (name, depth, found["penetration_of"], found["volume_drift"], found["inverted_prisms"], solution.converged)
        )
    print(f"{len(rows)} poses, {len(names)} shapes and {len(chosen)} pairs, {time.perf_counter() - begin:.0f} s")
    out = {"poses": len(rows), "at_rest": sum(row[5] for row in rows)}
    for pair in NAMES:
        depth = np.array([row[1][pair] for row in rows])
        worst = int(depth.argmax())
        out[pair] = {
            "max_mm": round(float(depth.max()), 3),
            "p95_mm": round(float(np.percentile(depth, 95)), 3),
            "over": int((depth > LIMIT).sum()),
            "worst": rows[worst][0],
            "own_max_mm": round(max(row[2][pair] for row in rows), 3),
        }
        print(
            f"{pair:13} deepest {depth.max():.3f} mm ({rows[worst][0]}), 95 % {np.percentile(depth, 95):.3f},", end=" "
        )
        print(f"over {LIMIT} mm: {out[pair]['over']}; as the solver tells it {out[pair]['own_max_mm']:.3f}")
    out["cheek_gum_own_max_mm"] = round(max(row[2]["cheek_gum"] for row in rows), 3)
    drift = np.array([abs(row[3]) for row in rows])
    out["volume_drift_max"] = round(float(drift.max()), 4)
    out["inverted_prisms_max"] = max(row[4] for row in rows)
    pressed = solve(model, control(model, CLOSED), max_iterations=200).state.positions
    out["lip_gap_pbm_mm"] = round(ruler.lip_gap(pressed), 3)
    out["lid_gap_mm"] = round(lid_gap(model), 3)
    print(f"volume drift at most {drift.max():.2%}; inverted prisms at most {out['inverted_prisms_max']}", end="; ")
    print(f"at rest {out['at_rest']} of {len(rows)}; lips apart on /p b m/ {out['lip_gap_pbm_mm']} mm", end="; ")
    print(f"drawn edges of shut lids apart by at most {out['lid_gap_mm']} mm")
    print(json.dumps(out))


if __name__ == "__main__":
    main()
