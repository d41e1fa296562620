// SPDX-License-Identifier: GPL-3.0-or-later
//
// From the hexahedra of the quarter model to the faces that can be seen, and their mirror images.
import type { Field } from './vtu.js';

/* The six faces of a VTK hexahedron, each with its outward normal by the right-hand rule. */
const hex_faces = [
  [0, 3, 2, 1],
  [4, 5, 6, 7],
  [0, 1, 5, 4],
  [1, 2, 6, 5],
  [2, 3, 7, 6],
  [3, 0, 4, 7],
] as const;

export interface Faces {
  nodes: Int32Array; /* [face][4] */
  element: Int32Array; /* [face]: whose face it is */
  count: number;
}

/* The faces of the elements that `wanted` selects which no other selected element shares. */
export function boundary_faces(field: Field, wanted: (element: number) => boolean): Faces {
  const single = new Map<string, { nodes: number[]; element: number }>();
  for (let e = 0; e < field.element_count; e++) {
    if (!wanted(e)) continue;
    for (const face of hex_faces) {
      const nodes = face.map((c) => field.corners[8 * e + c] as number);
      const key = [...nodes].sort((a, b) => a - b).join();
      if (!single.delete(key)) single.set(key, { nodes, element: e });
    }
  }
  const list = [...single.values()];
  return {
    nodes: Int32Array.from(list.flatMap((f) => f.nodes)),
    element: Int32Array.from(list, (f) => f.element),
    count: list.length,
  };
}

export interface Motion {
  /* Position of a node when the displacement is scaled by `scale` (1: as solved). */
  at: (node: number, axis: number, scale: number) => number;
  tip: number; /* the bone's lowest node */
}

export function motion_of(field: Field): Motion {
  const unloaded = (n: number, axis: number): number =>
    (field.position_mm[3 * n + axis] as number) - (field.displacement_mm[3 * n + axis] as number);
  let tip = 0;
  for (let n = 0; n < field.node_count; n++) {
    const on_axis = Math.abs(unloaded(n, 0)) < 1e-9 && Math.abs(unloaded(n, 1)) < 1e-9;
    if (on_axis && unloaded(n, 2) > unloaded(tip, 2) - 1e-9) tip = n;
  }
  return {
    at: (n, axis, scale) =>
      unloaded(n, axis) + scale * (field.displacement_mm[3 * n + axis] as number),
    tip,
  };
}

/* The part of the muscle's surface that is tied to the rigid bone: it moves exactly as the tip. */
export function bone_faces(field: Field, muscle: Faces, tip: number): Faces {
  const u = field.displacement_mm;
  const moves_with_bone = (n: number): boolean =>
    [0, 1, 2].every((a) => Math.abs((u[3 * n + a] as number) - (u[3 * tip + a] as number)) < 1e-7);
  const kept: number[] = [];
  for (let f = 0; f < muscle.count; f++) {
    const nodes = [0, 1, 2, 3].map((c) => muscle.nodes[4 * f + c] as number);
    if (nodes.every(moves_with_bone)) kept.push(f);
  }
  return {
    nodes: Int32Array.from(kept.flatMap((f) => [...muscle.nodes.subarray(4 * f, 4 * f + 4)])),
    element: Int32Array.from(kept, (f) => muscle.element[f] as number),
    count: kept.length,
  };
}

export type Quarter = readonly [1 | -1, 1 | -1];

/* The whole side; the first quarter is the one that is taken away to look inside. */
export const quarters: readonly Quarter[] = [
  [1, -1],
  [1, 1],
  [-1, 1],
  [-1, -1],
];

/* Coordinates of every face corner of the chosen quarters, [quarter][face][4][3]: corners are not
 * shared, so that each face keeps its own colour and its own flat normal. */
export function place(
  faces: Faces,
  motion: Motion,
  scale: number,
  chosen: readonly Quarter[],
): Float32Array {
  const out = new Float32Array(chosen.length * faces.nodes.length * 3);
  let k = 0;
  for (const [sx, sy] of chosen) {
    for (const n of faces.nodes) {
      out[k++] = sx * motion.at(n, 0, scale);
      out[k++] = sy * motion.at(n, 1, scale);
      out[k++] = motion.at(n, 2, scale);
    }
  }
  return out;
}

/* VTK's cell list for those corners; a mirrored face is walked the other way round. */
export function cells(faces: Faces, chosen: readonly Quarter[]): Uint32Array {
  const out = new Uint32Array(chosen.length * faces.count * 5);
  let k = 0;
  chosen.forEach(([sx, sy], q) => {
    const order = sx * sy > 0 ? [0, 1, 2, 3] : [3, 2, 1, 0];
    for (let f = 0; f < faces.count; f++) {
      out[k++] = 4;
      for (const c of order) out[k++] = 4 * (q * faces.count + f) + c;
    }
  });
  return out;
}

/* Free edges of the bone's bowl that are on no symmetry plane: its rim, as node pairs. */
export function rim_edges(bowl: Faces, motion: Motion): [number, number][] {
  const single = new Map<string, [number, number]>();
  for (let f = 0; f < bowl.count; f++) {
    for (let c = 0; c < 4; c++) {
      const a = bowl.nodes[4 * f + c] as number;
      const b = bowl.nodes[4 * f + ((c + 1) % 4)] as number;
      const key = a < b ? `${a},${b}` : `${b},${a}`;
      if (!single.delete(key)) single.set(key, [a, b]);
    }
  }
  const on_plane = ([a, b]: [number, number]): boolean =>
    [0, 1].some(
      (axis) => Math.abs(motion.at(a, axis, 0)) < 1e-9 && Math.abs(motion.at(b, axis, 0)) < 1e-9,
    );
  return [...single.values()].filter((edge) => !on_plane(edge));
}
