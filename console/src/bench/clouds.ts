/** A contact as it is drawn: level frame, metres. */

import type { Recognition, Triple } from "../contract";

/** A cluster that the user chose, packed x y z; the height of the LiDAR where it is known, metres. */
export interface Cluster {
  name: string;
  points: Float32Array;
  sensorHeight: number | null;
}

/** The restored cloud in its two parts, packed x y z. */
export interface Parts {
  measured: Float32Array;
  inferred: Float32Array;
}

/** Splits a restored cloud; below rung full, what was sent is all there is. */
export function partsOf(answer: Recognition, cluster: Cluster): Parts {
  const { restored } = answer;
  if (!restored) return { measured: cluster.points, inferred: new Float32Array() };
  const part = (wanted: boolean) =>
    Float32Array.from(restored.points.filter((_, index) => restored.measured[index] === wanted).flat());
  return { measured: part(true), inferred: part(false) };
}

/** Least and greatest x y z of packed points that are finite. */
export function bounds(points: Float32Array): { least: Triple; most: Triple } {
  const least: Triple = [Infinity, Infinity, Infinity];
  const most: Triple = [-Infinity, -Infinity, -Infinity];
  points.forEach((value, index) => {
    const axis = (index % 3) as 0 | 1 | 2;
    if (value < least[axis]) least[axis] = value;
    if (value > most[axis]) most[axis] = value;
  });
  return { least, most };
}

type Spot = [x: number, y: number];

/** Of the answer's box on the water: corners, and the arrow at its bow, which is a tip and two wings. */
export function outline({ box, heading }: Recognition): { corners: Spot[]; bow: Spot; wings: [Spot, Spot] } {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  const at = (ahead: number, port: number): Spot => [
    box.center[0] + ahead * cos - port * sin,
    box.center[1] + ahead * sin + port * cos,
  ];
  const [l, b] = [box.length / 2, box.beam / 2];
  return {
    corners: [at(-l, b), at(-l, -b), at(l, -b), at(l, b)],
    bow: at(l + Math.max(1.5, box.length / 6), 0),
    wings: [at(l, -b / 2), at(l, b / 2)],
  };
}
