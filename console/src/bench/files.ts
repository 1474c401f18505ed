/** Cluster files, read in the browser; the same formats as `shipshape classify`. */

import { unzipSync } from "fflate";
import { readNpy } from "./npy";

const MAX_BYTES = 64 * 2 ** 20;
const AXES = ["x", "y", "z"];
const BOX_SIDES = ["length", "width", "height"]; // beside x, y, z: the middles of detected boxes, not points

/** A cluster file as it was read; each cluster is packed x y z, metres, level frame. */
export interface ClusterFile {
  name: string;
  clusters: Float32Array[];
}

/**
 * Reads a file by its name's ending.
 * @throws Error One sentence: what was expected, what came.
 */
export async function readClusters(file: File): Promise<ClusterFile> {
  const ending = /\.(\w+)$/.exec(file.name)?.[1]?.toLowerCase() ?? "";
  const read = READERS[ending];
  if (!read)
    throw new Error(`expected a file that ends in .${Object.keys(READERS).join(", .")}, got ${file.name}`);
  if (file.size === 0 || file.size > MAX_BYTES) {
    throw new Error(`expected ${file.name} to hold 1 to ${MAX_BYTES} bytes, got ${file.size}`);
  }
  const clusters = await read(await file.arrayBuffer(), file.name);
  if (clusters.length === 0) throw new Error(`expected a cluster in ${file.name}, got none`);
  return { name: file.name, clusters };
}

const READERS: Record<string, (content: ArrayBuffer, name: string) => Promise<Float32Array[]> | Float32Array[]> = {
  npy: (content, name) => [pointsOf(readNpy(content, name), name)],
  npz: readNpz,
  csv: readText,
  xyz: readText,
  txt: readText,
  pcd: readPcd,
  ply: readPly,
};

function pointsOf({ shape, values }: { shape: number[]; values: Float64Array }, name: string): Float32Array {
  if (shape.length !== 2 || shape[1] !== 3) {
    throw new Error(`expected ${name} to be of shape (N, 3), got (${shape.join(", ")})`);
  }
  return Float32Array.from(values);
}

function readNpz(content: ArrayBuffer, name: string): Float32Array[] {
  const wanted = ["points.npy", "n.npy"];
  let files: Record<string, Uint8Array>;
  try {
    files = unzipSync(new Uint8Array(content), {
      filter: (entry) => {
        if (entry.originalSize > MAX_BYTES) throw new Error(`${entry.name} of ${entry.originalSize} bytes`);
        return wanted.includes(entry.name);
      },
    });
  } catch (error) {
    throw new Error(`expected ${name} to be a complete .npz file, got: ${causeOf(error)}`);
  }
  const [points, counts] = wanted.map((entry) => files[entry]);
  if (!points || !counts) throw new Error(`expected the arrays points and n in ${name}, got others`);
  const all = pointsOf(readNpy(points.slice().buffer, "points"), `points in ${name}`);
  const n = [...readNpy(counts.slice().buffer, "n").values];
  const total = n.reduce((sum, count) => sum + count, 0);
  if (total * 3 !== all.length || n.some((count) => count < 1)) {
    throw new Error(`expected n in ${name} to sum to the ${all.length / 3} points, got ${total}`);
  }
  let from = 0;
  return n.map((count) => all.subarray(from * 3, (from += count) * 3));
}

function readText(content: ArrayBuffer, name: string): Float32Array[] {
  const lines = new TextDecoder()
    .decode(content)
    .split(/\r?\n/)
    .filter((line) => line.trim() && !isComment(line));
  const first = lines[0];
  if (first === undefined) throw new Error(`expected a point a line in ${name}, got no lines`);
  const mark = [";", ",", "\t"].find((one) => first.includes(one)) ?? /\s+/;
  const cellsOf = (line: string) =>
    line
      .trim()
      .split(mark)
      .map((cell) => cell.trim());
  const named = cellsOf(first).every((cell) => Number.isNaN(Number(cell)));
  const header = cellsOf(first.replace(/^\s*#/, "")).map((cell) => /\w+/.exec(cell.toLowerCase())?.[0] ?? "");
  const columns = named ? AXES.map((axis) => header.indexOf(axis)) : [0, 1, 2];
  if (columns.includes(-1)) throw new Error(`expected the columns x, y, z in ${name}, got ${header.join(", ")}`);
  if (BOX_SIDES.every((side) => header.includes(side)))
    throw new Error(`expected points in ${name}, got a table of boxes`);
  const values = lines.slice(named ? 1 : 0).flatMap((line, index) => {
    const cells = cellsOf(line);
    const point = columns.map((column) => Number(cells[column] || Number.NaN));
    if (point.some(Number.isNaN) && !cells.some((cell) => /^[-+]?nan$/i.test(cell))) {
      throw new Error(
        `expected a number in every x, y, z column of ${name}, got ${JSON.stringify(line.slice(0, 60))} in line ${index + 1}`,
      );
    }
    return point;
  });
  return [Float32Array.from(values)];
}

/** A line led by # is a comment, unless it names the columns as some tools do. */
function isComment(line: string): boolean {
  const words = line.toLowerCase().split(/[\s,;#]+/);
  return line.trim().startsWith("#") && !AXES.every((axis) => words.includes(axis));
}

async function readPcd(content: ArrayBuffer, name: string): Promise<Float32Array[]> {
  const { PCDLoader } = await import("three/examples/jsm/loaders/PCDLoader.js");
  return [positions(() => new PCDLoader().parse(content).geometry, name, "PCD")];
}

async function readPly(content: ArrayBuffer, name: string): Promise<Float32Array[]> {
  const { PLYLoader } = await import("three/examples/jsm/loaders/PLYLoader.js");
  return [positions(() => new PLYLoader().parse(content), name, "PLY")];
}

interface Geometry {
  attributes: Record<string, { array: ArrayLike<number> } | unknown>;
}

/** The points of a parsed file; those that are not finite are directions without a return. */
function positions(parse: () => Geometry, name: string, format: string): Float32Array {
  let array: ArrayLike<number> | undefined;
  try {
    array = (parse().attributes.position as { array: ArrayLike<number> } | undefined)?.array;
  } catch (error) {
    throw new Error(`expected ${name} to be a complete ${format} file, got: ${causeOf(error)}`);
  }
  if (!array?.length) throw new Error(`expected the fields x, y, z in ${name}, got no points`);
  const all = Float32Array.from(array);
  return all.filter((_, index) => {
    const start = index - (index % 3);
    return [all[start], all[start + 1], all[start + 2]].every(Number.isFinite);
  });
}

function causeOf(error: unknown): string {
  if (error instanceof TypeError) return "a damaged header"; // a library that did not look what it found
  return error instanceof Error ? error.message : String(error);
}
