/** NumPy's .npy: a header in Python's own notation, then plain numbers or records. */

const MAGIC = [0x93, ...new TextEncoder().encode("NUMPY")];
const AXES = ["x", "y", "z"];
const READ: Record<string, (view: DataView, at: number, little: boolean) => number> = {
  f4: (view, at, little) => view.getFloat32(at, little),
  f8: (view, at, little) => view.getFloat64(at, little),
  i4: (view, at, little) => view.getInt32(at, little),
  i8: (view, at, little) => Number(view.getBigInt64(at, little)),
  u4: (view, at, little) => view.getUint32(at, little),
  u8: (view, at, little) => Number(view.getBigUint64(at, little)),
};

/** Where a number lies in its record, and of which kind it is: "<f4". */
interface Field {
  name: string;
  offset: number;
  kind: string;
}

/**
 * An array, whichever byte order, rows first; records with the fields x, y, z become rows of three.
 * @throws Error One sentence: what was expected, what came.
 */
export function readNpy(content: ArrayBuffer, name: string): { shape: number[]; values: Float64Array } {
  const [header, start] = split(content, name);
  const shape = [...(/'shape':\s*\(([^)]*)\)/.exec(header)?.[1] ?? "").matchAll(/\d+/g)].map(Number);
  const fields = fieldsOf(header);
  const record = fields.reduce((total, { kind }) => total + bytesOf(kind), 0);
  const wanted =
    fields.length === 1 ? fields : AXES.flatMap((axis) => fields.filter((field) => field.name === axis));
  const rows = shape.reduce((product, length) => product * length, 1);
  if (![1, 3].includes(wanted.length) || !wanted.every(isNumber) || /'fortran_order':\s*True/.test(header)) {
    throw new Error(`expected ${name} to hold plain numbers, rows first, got ${header.trim().slice(0, 80)}`);
  }
  if (start + rows * record !== content.byteLength) {
    throw new Error(`expected ${rows * record} bytes of numbers in ${name}, got ${content.byteLength - start}`);
  }
  const view = new DataView(content, start);
  const values = Float64Array.from({ length: rows * wanted.length }, (_, index) => {
    const { offset, kind } = wanted[index % wanted.length] as Field;
    const at = Math.floor(index / wanted.length) * record + offset;
    return READ[kind.slice(1)]?.(view, at, !kind.startsWith(">")) ?? Number.NaN;
  });
  return { shape: wanted.length === 1 ? shape : [...shape, wanted.length], values };
}

/** The header's text, and where the numbers begin. */
function split(content: ArrayBuffer, name: string): [header: string, start: number] {
  const view = new DataView(content);
  if (content.byteLength < 12 || MAGIC.some((byte, at) => view.getUint8(at) !== byte)) {
    throw new Error(`expected ${name} to be a NumPy array, got a file of another kind`);
  }
  const wide = view.getUint8(6) > 1; // from version 2 on, four bytes of length
  const from = wide ? 12 : 10;
  const start = from + (wide ? view.getUint32(8, true) : view.getUint16(8, true));
  return [new TextDecoder().decode(content.slice(from, start)), start];
}

/** One field without a name for plain numbers, else those of the records; none where they are of another form. */
function fieldsOf(header: string): Field[] {
  const plain = /'descr':\s*'([<>|=]\w+)'/.exec(header)?.[1];
  if (plain) return [{ name: "", offset: 0, kind: plain }];
  const list = /'descr':\s*\[(.*?)\]/.exec(header)?.[1] ?? "";
  let offset = 0;
  return [...list.matchAll(/\('([^']*)',\s*'([<>|=]\w+)'\)/g)].map(([, name = "", kind = ""]) => {
    const field = { name, offset, kind };
    offset += bytesOf(kind);
    return field;
  });
}

function bytesOf(kind: string): number {
  return Number(/\d+$/.exec(kind)?.[0] ?? 0);
}

function isNumber({ kind }: Field): boolean {
  return kind.slice(1) in READ;
}
