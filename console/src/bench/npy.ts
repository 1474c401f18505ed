/** NumPy's .npy: a header in Python's own notation, then plain numbers. */

const MAGIC = [0x93, ...new TextEncoder().encode("NUMPY")];
const READ: Record<string, [bytes: number, read: (view: DataView, at: number, little: boolean) => number]> = {
  f4: [4, (view, at, little) => view.getFloat32(at, little)],
  f8: [8, (view, at, little) => view.getFloat64(at, little)],
  i4: [4, (view, at, little) => view.getInt32(at, little)],
  i8: [8, (view, at, little) => Number(view.getBigInt64(at, little))],
  u4: [4, (view, at, little) => view.getUint32(at, little)],
  u8: [8, (view, at, little) => Number(view.getBigUint64(at, little))],
};

/**
 * An array, whichever byte order, rows first.
 * @throws Error One sentence: what was expected, what came.
 */
export function readNpy(content: ArrayBuffer, name: string): { shape: number[]; values: Float64Array } {
  const view = new DataView(content);
  if (content.byteLength < 12 || MAGIC.some((byte, at) => view.getUint8(at) !== byte)) {
    throw new Error(`expected ${name} to be a NumPy array, got a file of another kind`);
  }
  const wide = view.getUint8(6) > 1; // from version 2 on, four bytes of length
  const start = wide ? 12 : 10;
  const end = start + (wide ? view.getUint32(8, true) : view.getUint16(8, true));
  const header = new TextDecoder().decode(content.slice(start, end));
  const descr = /'descr':\s*'([<>|=])(\w+)'/.exec(header);
  const shape = [...(/'shape':\s*\(([^)]*)\)/.exec(header)?.[1] ?? "").matchAll(/\d+/g)].map(Number);
  const [size, read] = READ[descr?.[2] ?? ""] ?? [0, null];
  if (!read || /'fortran_order':\s*True/.test(header)) {
    throw new Error(`expected ${name} to hold plain numbers, rows first, got ${header.trim().slice(0, 80)}`);
  }
  const count = shape.reduce((product, length) => product * length, 1);
  if (end + count * size !== content.byteLength) {
    throw new Error(`expected ${count * size} bytes of numbers in ${name}, got ${content.byteLength - end}`);
  }
  const little = descr?.[1] !== ">";
  return {
    shape,
    values: Float64Array.from({ length: count }, (_, index) => read(view, end + index * size, little)),
  };
}
