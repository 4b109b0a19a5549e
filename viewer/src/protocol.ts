/**
 * The messages of the stream: JSON in both directions, and the binary frames that carry topology and data.
 *
 * Every number that a frame states is checked against the bytes that are there before it is used, so that a truncated,
 * garbled or hostile frame is a `ProtocolError` naming the place and never an exception of another kind, a read out of
 * bounds or an allocation beyond `MAXIMUM_FRAME_BYTES`.
 */
import { Decompress } from "fzstd";

export const PROTOCOL_VERSION = 1;
/** The most memory that the arrays of one frame may take once decompressed. */
export const MAXIMUM_FRAME_BYTES = 1 << 30;
const MAXIMUM_HEADER_BYTES = 1 << 20;
const MAXIMUM_WINDOW_BYTES = 1 << 27;
const MAXIMUM_ARRAYS = 256;
const MAXIMUM_COMPONENTS = 64;
const PREAMBLE_BYTES = 12;
const MAGIC = 0x4c424d54; // "TMBL", little endian

export type Vector = [number, number, number];
export type Association = "vertex" | "element";
export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
export type Role = "driver" | "watcher";

export interface ViewInformation { name: string; kind: string }
export interface FeatureInformation { name: string; faces: number; vertices: number; bounds: [Vector, Vector] }
export interface FieldInformation { name: string; association: Association; components: number }
export interface ParameterInformation { name: string; value: number; minimum?: number | null; maximum?: number | null }

/** The surface from which shapes are measured; its points are sent on request only. */
export interface SurfaceInformation { id: string; vertices: number; faces: number }

export interface Hello {
  protocol: number;
  client: string | number;
  role: Role;
  channel?: string | null;
  views: ViewInformation[];
  features: FeatureInformation[];
  surface?: SurfaceInformation | null;
  fields: FieldInformation[];
  parameters: ParameterInformation[];
  schemas: { order?: Json };
  stack: Json[];
  orders: OrderStatus[];
  defaults: { deform?: Json; guard?: Json; schedule?: Json };
}

export interface QualitySummary { min: number; mean?: number; inverted?: number }

export interface Status {
  cycle: number;
  time: number;
  paused: boolean;
  stopped: boolean;
  step_seconds?: number | null;
  viewers?: number;
  driver?: string | number | null;
  quality?: QualitySummary | null;
}

export type OrderState = "accepted" | "computing" | "applying" | "applied" | "rejected";

export interface OrderStatus {
  id: string;
  status: OrderState;
  /** What was asked for; told when it comes in, and in `hello`. */
  order?: Json;
  reason?: string | null;
  cycle_applied?: number | null;
  shape?: number | null;
  shapes?: number | null;
  min_scaled_jacobian?: number | null;
  /** What the guard judged; the surface alone where the solver moves its volume by itself. */
  judged?: "volume" | "surface" | null;
  /** The first shape that the solver did not move its mesh to. */
  not_followed?: { cycle: number; shape: number; distance: number } | null;
  deviation?: number | null;
  largest_displacement?: number | null;
  seconds?: { surface?: number; volume?: number; guard?: number } | null;
  added_steps?: number | null;
}

/** What an order would come to, for the viewer that asked. */
export interface ForecastAnswer {
  id?: string | null;
  order: {
    outcome: "applied" | "clamped" | "rejected";
    reason?: string | null;
    fraction?: number | null;
    min_scaled_jacobian?: number | null;
    judged?: "volume" | "surface" | null;
    largest_displacement?: number | null;
    shapes?: number | null;
    sub_steps?: number | null;
    quality?: QualitySummary | null;
    seconds?: { surface?: number; volume?: number; guard?: number } | null;
  };
}

export interface Monitor { pipeline: string; cycle: number; values: Record<string, number> }
export interface ServerError { message: string; id?: string | null }

export type ServerMessage =
  | { kind: "hello"; body: Hello }
  | { kind: "status"; body: Status }
  | { kind: "order"; body: OrderStatus }
  | { kind: "forecast"; body: ForecastAnswer }
  | { kind: "monitor"; body: Monitor }
  | { kind: "error"; body: ServerError };

export type ClientMessage = { id?: string } & (
  | { order: Json } | { forecast: Json } | { pause: object } | { resume: object } | { stop: object }
  | { parameter: { name: string; value: number } } | { drive: object }
);

/** Raised for a message that does not follow the protocol; the text says where it departs from it. */
export class ProtocolError extends Error {
  constructor(message: string) {
    super(message);
    this.name = "ProtocolError";
  }
}

/** The shape of one view: what connects its points. `triangleFeatures` numbers the features of `hello`. */
export interface TopologyFrame {
  kind: "topology";
  view: string;
  topology: string;
  points: number;
  triangles: Uint32Array;
  triangleFeatures: Uint32Array | null;
  lines: Uint32Array;
}

/** One array of a data frame, interleaved (x0 y0 z0 x1 ...). `range` is that of the magnitude for vectors. */
export interface DataArray {
  name: string;
  association: Association;
  components: number;
  values: Float32Array;
  range: [number, number] | null;
}

/** The values of one view at one cycle; `points` are the coordinates, null where the frame leaves them as they were. */
export interface DataFrame {
  kind: "data";
  view: string;
  topology: string;
  cycle: number;
  time: number;
  points: Float32Array | null;
  fields: DataArray[];
}

export type Frame = TopologyFrame | DataFrame;
type JsonObject = { [key: string]: Json };

const isObject = (value: unknown): value is JsonObject =>
  typeof value === "object" && value !== null && !Array.isArray(value);

/** Parses a text message: one object whose one key says what it is. */
export function parseServerMessage(text: string): ServerMessage {
  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch {
    throw new ProtocolError("a text message that is not JSON");
  }
  if (!isObject(parsed)) throw new ProtocolError("a text message that is not a JSON object");
  for (const kind of ["hello", "status", "order", "forecast", "monitor", "error"] as const) {
    const body: unknown = parsed[kind];
    if (body === undefined) continue;
    if (!isObject(body)) throw new ProtocolError(`the message "${kind}" is not an object`);
    if (kind === "forecast" && !isObject(body.order)) throw new ProtocolError('the message "forecast" has no order');
    return { kind, body: kind === "hello" ? completeHello(body) : body } as unknown as ServerMessage;
  }
  throw new ProtocolError(`an unknown message: ${Object.keys(parsed).slice(0, 3).join(", ") || "{}"}`);
}

function completeHello(body: JsonObject): Hello {
  if (body.protocol !== PROTOCOL_VERSION) {
    throw new ProtocolError(`the server speaks protocol ${String(body.protocol)}, this viewer ${PROTOCOL_VERSION}`);
  }
  const list = (key: string): Json[] => (Array.isArray(body[key]) ? body[key] : []);
  const object = (key: string): JsonObject => (isObject(body[key]) ? body[key] : {});
  return {
    ...body,
    views: list("views"), features: list("features"), fields: list("fields"), parameters: list("parameters"),
    stack: list("stack"), orders: list("orders"), schemas: object("schemas"), defaults: object("defaults"),
  } as unknown as Hello;
}

interface Header { kind: 1 | 2; header: JsonObject; blobs: Uint8Array }

function openFrame(bytes: Uint8Array): Header {
  if (bytes.byteLength < PREAMBLE_BYTES) throw new ProtocolError(`a frame of ${bytes.byteLength} bytes, shorter than its preamble`);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (view.getUint32(0, true) !== MAGIC) throw new ProtocolError("a frame that does not begin with TMBL");
  const version = view.getUint8(4);
  if (version !== 1) throw new ProtocolError(`a frame of version ${version}, expected 1`);
  const kind = view.getUint8(5);
  if (kind !== 1 && kind !== 2) throw new ProtocolError(`a frame of kind ${kind}, expected 1 (topology) or 2 (data)`);
  const length = view.getUint32(8, true);
  if (length > MAXIMUM_HEADER_BYTES || PREAMBLE_BYTES + length > bytes.byteLength) {
    throw new ProtocolError(`a frame whose header claims ${length} bytes, of ${bytes.byteLength - PREAMBLE_BYTES} there`);
  }
  let header: unknown;
  try {
    header = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes.subarray(PREAMBLE_BYTES, PREAMBLE_BYTES + length)));
  } catch {
    throw new ProtocolError("a frame whose header is not JSON");
  }
  if (!isObject(header)) throw new ProtocolError("a frame whose header is not an object");
  return { kind, header, blobs: bytes.subarray(PREAMBLE_BYTES + length) };
}

/** The view and the kind of a frame, without decoding its arrays. */
export function peekFrame(bytes: Uint8Array): { kind: "topology" | "data"; view: string } {
  const { kind, header } = openFrame(bytes);
  return { kind: kind === 1 ? "topology" : "data", view: text(header, "view", "the header") };
}

/** Decodes a binary frame. Throws `ProtocolError` and nothing else. */
export function decodeFrame(bytes: Uint8Array): Frame {
  const { kind, header, blobs } = openFrame(bytes);
  const arrays = new Blobs(blobs, header.arrays);
  const view = text(header, "view", "the header");
  const topology = text(header, "topology", "the header");
  try {
    return kind === 1 ? decodeTopology(view, topology, header, arrays) : decodeData(view, topology, header, arrays);
  } catch (error) {
    if (error instanceof RangeError) throw new ProtocolError(`view ${view}: there is not enough memory for a frame of this size`);
    throw error;
  }
}

function decodeTopology(view: string, topology: string, header: JsonObject, arrays: Blobs): TopologyFrame {
  const points = whole(header, "points", "the header");
  let triangles = new Uint32Array(0);
  let lines = new Uint32Array(0);
  let triangleFeatures: Uint32Array | null = null;
  for (const entry of arrays.entries()) {
    const components = entry.name === "triangles" ? 3 : entry.name === "lines" ? 2 : 1;
    if (!["triangles", "lines", "triangle_features"].includes(entry.name)) continue;
    if (entry.components !== components) {
      throw new ProtocolError(`${entry.place}: ${entry.components} components, expected ${components}`);
    }
    const values = interleave(Uint32Array.from(entry.integers("none")), entry.count, components);
    if (entry.name === "triangle_features") triangleFeatures = values;
    else {
      for (const value of values) {
        if (value >= points) throw new ProtocolError(`${entry.place}: point ${value} of ${points}`);
      }
      if (entry.name === "triangles") triangles = values;
      else lines = values;
    }
  }
  if (triangleFeatures && triangleFeatures.length !== triangles.length / 3) {
    throw new ProtocolError(`${triangleFeatures.length} triangle features for ${triangles.length / 3} triangles`);
  }
  return { kind: "topology", view, topology, points, triangles, triangleFeatures, lines };
}

function decodeData(view: string, topology: string, header: JsonObject, arrays: Blobs): DataFrame {
  const frame: DataFrame = {
    kind: "data", view, topology,
    cycle: finite(header.cycle, "the header: cycle"), time: finite(header.time, "the header: time"),
    points: null, fields: [],
  };
  for (const entry of arrays.entries()) {
    const values = entry.floats();
    if (entry.name === "points") {
      if (entry.components !== 3) throw new ProtocolError(`${entry.place}: ${entry.components} components, expected 3`);
      frame.points = values;
    } else {
      const association = entry.header.association === "element" ? "element" : "vertex";
      frame.fields.push({ name: entry.name, association, components: entry.components, values, range: entry.range() });
    }
  }
  return frame;
}

const TYPES = {
  u8: { bytes: 1, make: (buffer: ArrayBuffer) => new Uint8Array(buffer) },
  u16: { bytes: 2, make: (buffer: ArrayBuffer) => new Uint16Array(buffer) },
  u32: { bytes: 4, make: (buffer: ArrayBuffer) => new Uint32Array(buffer) },
  f32: { bytes: 4, make: (buffer: ArrayBuffer) => new Float32Array(buffer) },
  f64: { bytes: 8, make: (buffer: ArrayBuffer) => new Float64Array(buffer) },
} as const;
type TypeName = keyof typeof TYPES;
type Integers = Uint8Array | Uint16Array | Uint32Array;

/** One array of a frame: what its header says, and its values once they are asked for. */
class Entry {
  constructor(
    readonly header: JsonObject, readonly place: string, readonly name: string, readonly type: TypeName,
    readonly count: number, readonly components: number, private readonly compressed: Uint8Array,
  ) {}

  get size(): number {
    return this.count * this.components * TYPES[this.type].bytes;
  }

  private raw(): Integers | Float32Array | Float64Array {
    return TYPES[this.type].make(decompress(this.compressed, this.size, this.place));
  }

  /** The integers as they were before the filter, planar. */
  integers(assumed: "none" | "delta"): Integers {
    const values = this.raw();
    if (values instanceof Float32Array || values instanceof Float64Array) {
      throw new ProtocolError(`${this.place}: type ${this.type}, expected u8, u16 or u32`);
    }
    const filter = this.header.filter ?? assumed;
    if (filter === "delta") undoDelta(values);
    else if (filter !== "none") throw new ProtocolError(`${this.place}: unknown filter ${JSON.stringify(filter)}`);
    return values;
  }

  /** The values as interleaved single precision numbers, which is what is drawn. */
  floats(): Float32Array {
    const { count, components } = this;
    const result = new Float32Array(count * components);
    if (this.type === "f32" || this.type === "f64") {
      const raw = this.raw();
      for (let c = 0; c < components; c++) {
        for (let i = 0; i < count; i++) result[i * components + c] = raw[c * count + i]!;
      }
      return result;
    }
    if (count === 0) return result;
    // Without a quantum the integers are the values.
    const plain = (this.header.quantum ?? null) === null;
    const quantum = plain ? Array<number>(components).fill(1) : numbers(this.header.quantum, components, `${this.place}: quantum`);
    const offset = plain ? Array<number>(components).fill(0) : numbers(this.header.offset, components, `${this.place}: offset`);
    const integers = this.integers("none");
    for (let c = 0; c < components; c++) {
      const step = quantum[c]!;
      const base = offset[c]!;
      for (let i = 0; i < count; i++) result[i * components + c] = base + step * integers[c * count + i]!;
    }
    return result;
  }

  range(): [number, number] | null {
    const range = this.header.range;
    if (!Array.isArray(range)) return null;
    const [low, high] = range;
    return typeof low === "number" && typeof high === "number" && low <= high ? [low, high] : null;
  }
}

/** The arrays of a frame, laid one after the other behind the header. */
class Blobs {
  private readonly list: Entry[] = [];

  constructor(blobs: Uint8Array, headers: Json | undefined) {
    if (!Array.isArray(headers)) throw new ProtocolError("the header has no list of arrays");
    if (headers.length > MAXIMUM_ARRAYS) throw new ProtocolError(`${headers.length} arrays, at most ${MAXIMUM_ARRAYS} are read`);
    let at = 0;
    let total = 0;
    headers.forEach((header, index) => {
      const place = `array ${index}`;
      if (!isObject(header)) throw new ProtocolError(`${place} is not an object`);
      const name = text(header, "name", place);
      const named = `${place} (${name.slice(0, 60)})`;
      const type = text(header, "type", named);
      if (!Object.hasOwn(TYPES, type)) throw new ProtocolError(`${named}: unknown type ${type.slice(0, 20)}`);
      const components = header.components === undefined ? 1 : whole(header, "components", named);
      if (components < 1 || components > MAXIMUM_COMPONENTS) throw new ProtocolError(`${named}: ${components} components`);
      const bytes = whole(header, "bytes", named);
      if (at + bytes > blobs.byteLength) {
        throw new ProtocolError(`${named}: ${bytes} bytes claimed, ${blobs.byteLength - at} there: the frame is truncated`);
      }
      const entry = new Entry(header, named, name, type as TypeName, whole(header, "count", named), components, blobs.subarray(at, at + bytes));
      at += bytes;
      total += entry.size;
      if (total > MAXIMUM_FRAME_BYTES) throw new ProtocolError(`${named}: more than ${MAXIMUM_FRAME_BYTES} bytes in one frame`);
      this.list.push(entry);
    });
    if (at !== blobs.byteLength) throw new ProtocolError(`${blobs.byteLength - at} bytes behind the last array`);
  }

  entries(): readonly Entry[] {
    return this.list;
  }
}

/** Undoes the filter in place: each integer is the zigzag of its difference to the one before, wrapping in its type. */
function undoDelta(values: Integers): void {
  let previous = 0;
  for (let i = 0; i < values.length; i++) {
    const zigzag = values[i]!;
    previous = (previous + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
    values[i] = previous;
    previous = values[i]!;
  }
}

function interleave(planar: Uint32Array<ArrayBuffer>, count: number, components: number): Uint32Array<ArrayBuffer> {
  if (components === 1) return planar;
  const result = new Uint32Array(planar.length);
  for (let c = 0; c < components; c++) {
    for (let i = 0; i < count; i++) result[i * components + c] = planar[c * count + i]!;
  }
  return result;
}

/** Decompresses a blob that must hold exactly `size` bytes; never allocates more than that and one zstd window. */
function decompress(blob: Uint8Array, size: number, place: string): ArrayBuffer {
  const result = new Uint8Array(size);
  if (size === 0 && blob.byteLength === 0) return result.buffer;
  if (zstdWindow(blob) > MAXIMUM_WINDOW_BYTES + size) throw new ProtocolError(`${place}: its zstd window is too large`);
  let at = 0;
  try {
    const stream = new Decompress((chunk) => {
      if (at + chunk.byteLength > size) throw new ProtocolError(`${place}: more than the ${size} bytes that its header states`);
      result.set(chunk, at);
      at += chunk.byteLength;
    });
    stream.push(blob, true);
  } catch (error) {
    if (error instanceof ProtocolError) throw error;
    throw new ProtocolError(`${place}: broken zstd data (${error instanceof Error ? error.message : String(error)})`);
  }
  if (at !== size) throw new ProtocolError(`${place}: ${at} bytes, expected ${size}`);
  return result.buffer;
}

/** The memory that a zstd frame asks for before it yields a byte (RFC 8878, 3.1.1.1). */
function zstdWindow(blob: Uint8Array): number {
  const flags = blob[4] ?? 0;
  if (((flags >> 5) & 1) === 0) {
    const descriptor = blob[5] ?? 0;
    const base = 2 ** (10 + (descriptor >> 3));
    return base + (base / 8) * (descriptor & 7);
  }
  const start = 5 + [0, 1, 2, 4][flags & 3]!;
  const length = [1, 2, 4, 8][flags >> 6]!;
  let size = 0;
  for (let i = length - 1; i >= 0; i--) size = size * 256 + (blob[start + i] ?? 0);
  return size;
}

function text(header: JsonObject, key: string, place: string): string {
  const value = header[key];
  if (typeof value !== "string") throw new ProtocolError(`${place}: "${key}" is not a text`);
  return value;
}

function whole(header: JsonObject, key: string, place: string): number {
  const value = header[key];
  if (typeof value !== "number" || !Number.isSafeInteger(value) || value < 0 || value > 0xffffffff) {
    throw new ProtocolError(`${place}: "${key}" is not a whole number`);
  }
  return value;
}

function finite(value: Json | undefined, place: string): number {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new ProtocolError(`${place} is not a number`);
  return value;
}

function numbers(value: Json | undefined, count: number, place: string): number[] {
  if (!Array.isArray(value) || value.length !== count) throw new ProtocolError(`${place} is not a list of ${count} numbers`);
  return value.map((entry) => finite(entry, place));
}
