/** Makes binary frames as a server does; for the tests and for the stand-in server. */

const BYTES = { u8: 1, u16: 2, u32: 4, f32: 4, f64: 8 };
const ARRAYS = { u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array };

/**
 * A zstd frame of raw and run-length blocks (RFC 8878): no compression worth the name, but every decoder reads it.
 * @param {Uint8Array} bytes
 */
export function zstd(bytes) {
  const head = [0x28, 0xb5, 0x2f, 0xfd, 0xa0, bytes.length & 255, (bytes.length >> 8) & 255, (bytes.length >> 16) & 255, bytes.length >>> 24];
  const parts = [Uint8Array.from(head)];
  const BLOCK = 1 << 17;
  for (let at = 0; at === 0 || at < bytes.length; at += BLOCK) {
    const block = bytes.subarray(at, at + BLOCK);
    const last = at + BLOCK >= bytes.length ? 1 : 0;
    const word = last | (block.length << 3);
    parts.push(Uint8Array.from([word & 255, (word >> 8) & 255, word >> 16]), block);
  }
  return concat(parts);
}

/** @param {Uint8Array[]} parts */
export function concat(parts) {
  const result = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    result.set(part, at);
    at += part.length;
  }
  return result;
}

/**
 * Zigzag of the difference to the one before, wrapping in the type.
 * @param {ArrayLike<number>} integers @param {"u8"|"u16"|"u32"} type
 */
export function delta(integers, type) {
  const bits = BYTES[type] * 8;
  const shift = 32 - bits;
  const result = new ARRAYS[type](integers.length);
  let previous = 0;
  for (let i = 0; i < integers.length; i++) {
    const difference = ((integers[i] - previous) << shift) >> shift;
    result[i] = (difference << 1) ^ (difference >> 31);
    previous = integers[i];
  }
  return result;
}

/** @param {ArrayLike<number>} values interleaved @param {number} components */
export function planar(values, components) {
  const count = values.length / components;
  return Array.from({ length: values.length }, (_, i) => values[(i % count) * components + Math.floor(i / count)]);
}

/** @param {number} kind @param {object} header @param {Uint8Array[]} blobs */
export function frame(kind, header, blobs) {
  const json = new TextEncoder().encode(JSON.stringify(header));
  const preamble = new Uint8Array(12);
  preamble.set([0x54, 0x4d, 0x42, 0x4c, 1, kind]);
  new DataView(preamble.buffer).setUint32(8, json.length, true);
  return concat([preamble, json, ...blobs]);
}

/** @param {{ buffer: ArrayBufferLike, byteOffset: number, byteLength: number }} array */
const bytesOf = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

/** @param {string} view @param {string} topology @param {number} points @param {number[]} triangles @param {number[] | null} features @param {number[]} lines */
export function topologyFrame(view, topology, points, triangles, features = null, lines = []) {
  const arrays = [];
  const blobs = [];
  const add = (name, values, components) => {
    const blob = zstd(bytesOf(delta(planar(values, components), "u32")));
    arrays.push({ name, type: "u32", count: values.length / components, components, bytes: blob.length, filter: "delta" });
    blobs.push(blob);
  };
  if (triangles.length) add("triangles", triangles, 3);
  if (features) add("triangle_features", features, 1);
  if (lines.length) add("lines", lines, 2);
  return frame(1, { view, topology, points, arrays }, blobs);
}

/**
 * A data frame whose arrays are quantised to `type`.
 * @param {string} view @param {string} topology @param {number} cycle @param {number} time
 * @param {{ name: string, association?: string, components: number, values: ArrayLike<number>, type?: "u8"|"u16"|"u32"|"f32"|"f64", filter?: string }[]} fields
 */
export function dataFrame(view, topology, cycle, time, fields) {
  const arrays = [];
  const blobs = [];
  for (const { name, association = "vertex", components, values, type = "u16", filter = "delta" } of fields) {
    const count = values.length / components;
    const planes = planar(values, components);
    const header = { name, association, components, count, type, filter: "none", quantum: null, offset: null, range: null, bytes: 0 };
    let packed;
    if (type === "f32" || type === "f64") packed = ARRAYS[type].from(planes);
    else {
      const steps = 2 ** (BYTES[type] * 8) - 1;
      header.filter = filter;
      header.quantum = [];
      header.offset = [];
      const integers = [];
      for (let c = 0; c < components; c++) {
        const plane = planes.slice(c * count, (c + 1) * count);
        const low = plane.reduce((a, b) => Math.min(a, b), Infinity);
        const high = plane.reduce((a, b) => Math.max(a, b), -Infinity);
        const quantum = high > low ? (high - low) / steps : 1;
        header.quantum.push(quantum);
        header.offset.push(low);
        for (const value of plane) integers.push(Math.round((value - low) / quantum));
      }
      packed = filter === "delta" ? delta(integers, type) : ARRAYS[type].from(integers);
    }
    const blob = zstd(bytesOf(packed));
    header.bytes = blob.length;
    arrays.push(header);
    blobs.push(blob);
  }
  return frame(2, { view, topology, cycle, time, arrays }, blobs);
}
