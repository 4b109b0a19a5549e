/**
 * The geometry kernel: a WebAssembly module of the very code that changes the shape in the solver (`viewer/wasm`).
 *
 * Where the module itself fails, the surfaces that were open are opened again when they are next used.
 */
import type { Association, DataFrame, Frame, Json, TopologyFrame } from "../connection/protocol";
import { Module, compile, encoder } from "./module";
import type { Border } from "./module";

/** The parts of a surface; points interleaved, faces by point numbers. */
export interface SurfaceParts {
  points: Float64Array;
  /** The mesh vertex of each point, rising. */
  vertices: Uint32Array;
  faceSizes: Uint32Array;
  facePoints: Uint32Array;
  faceFeatures: Uint32Array;
  features: string[];
}

/** What there is to draw of a surface. */
export interface SurfaceDescription {
  points: Float64Array;
  triangles: Uint32Array;
  triangleFeatures: Uint32Array;
  vertices: Uint32Array;
  features: string[];
}

/** What is wrong with a shape, in a line; the triangles where it is seen first. Null for a sound one. */
export interface ShapeFaults { text: string; triangles: Uint32Array }

/** Curves through a surface: places of the nodes, the nodes of each curve, and the node that carries each vertex. */
export interface SkeletonDescription { nodes: Float64Array; curves: Uint32Array[]; nodeOfVertex: Uint32Array }

/** What the module says of a frame; its arrays come behind it. */
interface FrameHeader {
  view: string; topology: string; cycle: number; time: number; points: number; cells: boolean; features: boolean;
  fields: { name: string; association: Association; components: number }[];
}

interface Exports extends Border {
  open_surface(): number;
  create_surface(points: number, faces: number, corners: number): number;
  close_surface(surface: number): void;
  describe_surface(surface: number): number;
  displacement(surface: number): number;
  check(surface: number): number;
  skeleton(surface: number): number;
  decode_frame(): number;
  rehearse(): number;
}

/** Compiles the module while it is still arriving. Workers are sent what this gives. */
export const compileKernel = (): Promise<WebAssembly.Module> => compile(new URL("../../wasm/pkg/kernel.wasm", import.meta.url), "the geometry kernel");

export class Kernel extends Module<Exports> {
  constructor(module: WebAssembly.Module) {
    super(module, "the geometry kernel");
  }

  /** Has the module make a small edit of its own, so that the engine has compiled it well before the first that somebody waits for. */
  rehearse(): void {
    this.call([], (exports) => exports.rehearse(), () => undefined);
  }

  /** Opens the surface of a frame, as a server sends it. */
  openSurface(frame: Uint8Array): KernelSurface {
    return new KernelSurface(this, () => this.call([frame], (exports) => exports.open_surface(), () => undefined));
  }

  createSurface(parts: SurfaceParts): KernelSurface {
    const arrays = [parts.points, parts.vertices, parts.faceSizes, parts.facePoints, parts.faceFeatures];
    const bytes = [...arrays.map((array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength)), encoder.encode(JSON.stringify(parts.features))];
    const open = (exports: Exports): number => exports.create_surface(parts.vertices.length, parts.faceSizes.length, parts.facePoints.length);
    return new KernelSurface(this, () => this.call(bytes, open, () => undefined));
  }

  /** Decodes the next frame of a view: its topology, where it brings one, and its values. What is known of the view is kept in the module. */
  decodeFrame(message: Uint8Array): Frame[] {
    return this.call([message], (exports) => exports.decode_frame(), () => {
      const { view, topology, cycle, time, points, fields, cells, features } = JSON.parse(this.text(0)) as FrameHeader;
      const data: DataFrame = {
        kind: "data", view, topology, cycle, time, points: new Float32Array(this.bytes(1)),
        fields: fields.map((field, index) => ({ ...field, values: new Float64Array(this.bytes(2 + index)) })),
      };
      if (!cells) return [data];
      const numbers = (index: number): Uint32Array => new Uint32Array(this.bytes(2 + fields.length + index));
      const frame: TopologyFrame = {
        kind: "topology", view, topology, points, triangles: numbers(0), lines: numbers(1), triangleFeatures: features ? numbers(2) : null,
      };
      return [frame, data];
    }).answer;
  }
}

/** A surface in the module, with what was set up to edit it. */
export class KernelSurface {
  private number: number;
  private generation: number;

  constructor(private readonly kernel: Kernel, private readonly open: () => { result: number }) {
    this.number = open().result;
    this.generation = kernel.generation;
  }

  private here(): number {
    if (this.generation !== this.kernel.generation) {
      this.number = this.open().result;
      this.generation = this.kernel.generation;
    }
    return this.number;
  }

  describe(): SurfaceDescription {
    const surface = this.here();
    return this.kernel.call([], (exports) => exports.describe_surface(surface), () => ({
      points: new Float64Array(this.kernel.bytes(0)), triangles: new Uint32Array(this.kernel.bytes(1)),
      triangleFeatures: new Uint32Array(this.kernel.bytes(2)), vertices: new Uint32Array(this.kernel.bytes(3)),
      features: JSON.parse(this.kernel.text(4)) as string[],
    })).answer;
  }

  /** The displacement of each vertex from the reference, interleaved, that a stack of edits asks for. */
  displacement(stack: Json): Float64Array {
    const surface = this.here();
    const input = encoder.encode(JSON.stringify(stack));
    return this.kernel.call([input], (exports) => exports.displacement(surface), () => new Float64Array(this.kernel.bytes(0))).answer;
  }

  /** What is wrong with the shape of the displacement that was last asked for. */
  check(): ShapeFaults | null {
    const surface = this.here();
    return this.kernel.call([], (exports) => exports.check(surface), () => {
      const text = this.kernel.text(0);
      return text === "" ? null : { text, triangles: new Uint32Array(this.kernel.bytes(1)) };
    }).answer;
  }

  /** The skeleton, extracted when it is first asked for. */
  skeleton(): SkeletonDescription {
    const surface = this.here();
    return this.kernel.call([], (exports) => exports.skeleton(surface), () => {
      const sizes = new Uint32Array(this.kernel.bytes(1));
      const nodes = new Uint32Array(this.kernel.bytes(2));
      let at = 0;
      const curves = Array.from(sizes, (size) => nodes.subarray(at, (at += size)));
      return { nodes: new Float64Array(this.kernel.bytes(0)), curves, nodeOfVertex: new Uint32Array(this.kernel.bytes(3)) };
    }).answer;
  }

  close(): void {
    if (this.generation !== this.kernel.generation) return;
    this.kernel.call([], (exports) => {
      exports.close_surface(this.number);
      return 1;
    }, () => undefined);
    this.generation = -1;
  }
}
