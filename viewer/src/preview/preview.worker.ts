/** Computes previews of edits away from the thread that draws. */
import { Kernel } from "../kernel/kernel";
import { KernelError } from "../kernel/module";
import type { FailureKind } from "../kernel/module";
import type { KernelSurface, ShapeFaults, SkeletonDescription, SurfaceDescription } from "../kernel/kernel";
import type { Json } from "../connection/protocol";
import { segmentsOf } from "../picture/skeleton";
import type { Bones } from "../picture/skeleton";

/** The module, once. */
type PreviewModule = { module: WebAssembly.Module };

export type PreviewRequest =
  /** A reference surface, as the server sends it. */
  | { id: string; surface: ArrayBuffer }
  /** The edits that the shape has now, and those of the shape to be previewed. */
  | { number: number; stack: Json[]; wished: Json[] }
  /** Whether the shape of the last preview is sound. */
  | { check: number }
  /** The skeleton of the surface that is open, and where these edits have brought it. */
  | { skeleton: string; stack: Json[] }
  /** Where the points of the surface that is open lie in the reference, and where these edits have brought them. */
  | { shape: string; stack: Json[] };

export type PreviewAnswer =
  | { id: string; surface: Pick<SurfaceDescription, "triangles" | "triangleFeatures" | "features"> }
  /** `nodes` are those of the skeleton, where it is known. */
  | { number: number; points: Float32Array; nodes: Float32Array | null; largest: number; moved: number[]; size: number; milliseconds: number }
  | { check: number; faults: ShapeFaults | null }
  | { skeleton: string; bones: Bones }
  | { shape: string; reference: Float64Array; points: Float32Array }
  | { shape: string; kind: FailureKind; error: string }
  | { skeleton: string; kind: FailureKind; error: string }
  | { number: number; kind: FailureKind; error: string }
  | { id: string; kind: FailureKind; error: string };

const worker = self as unknown as {
  onmessage: ((event: MessageEvent<PreviewModule | PreviewRequest>) => void) | null;
  postMessage(answer: PreviewAnswer, transfer: Transferable[]): void;
};

let loaded: (kernel: Kernel) => void;
const kernel = new Promise<Kernel>((resolve) => { loaded = resolve; });
let surface: KernelSurface | null = null;
let reference: Float64Array = new Float64Array(0);
let size = 0;
/** The triangles of the reference and the feature of each, to say how far each feature moves. */
let faces: { triangles: Uint32Array; features: Uint32Array; count: number } = { triangles: new Uint32Array(0), features: new Uint32Array(0), count: 0 };
let featureNames: string[] = [];
/** The skeleton of the surface, once it was asked for. */
let skeleton: SkeletonDescription | null = null;
/** The displacement that the shape has now, and the stack that it is of. */
let now: { stack: string; displacement: Float64Array } = { stack: "", displacement: new Float64Array(0) };

async function answer(request: PreviewRequest): Promise<void> {
  if ("surface" in request) {
    surface?.close();
    surface = null;
    surface = (await kernel).openSurface(new Uint8Array(request.surface));
    const { points, triangles, triangleFeatures, features } = surface.describe();
    reference = points;
    featureNames = features;
    skeleton = null;
    size = diagonal(points);
    faces = { triangles: triangles.slice(), features: triangleFeatures.slice(), count: features.length };
    now = { stack: "[]", displacement: new Float64Array(points.length) };
    worker.postMessage({ id: request.id, surface: { triangles, triangleFeatures, features } }, [triangles.buffer, triangleFeatures.buffer]);
    return;
  }
  if (!surface) throw new KernelError("handle", "the reference surface has not arrived yet");
  if ("check" in request) {
    worker.postMessage({ check: request.check, faults: surface.check() }, []);
    return;
  }
  const start = performance.now();
  const stack = JSON.stringify(request.stack);
  if (now.stack !== stack) now = { stack, displacement: surface.displacement(request.stack) };
  if ("skeleton" in request) {
    skeleton ??= surface.skeleton();
    const { nodes, curves } = skeleton;
    const bones: Bones = {
      reference: nodes, now: nodesOf(skeleton, now.displacement), preview: null, curves, features: featuresOf(skeleton), ...segmentsOf(curves, nodes.length / 3),
    };
    worker.postMessage({ skeleton: request.skeleton, bones }, []);
    return;
  }
  if ("shape" in request) {
    const points = Float32Array.from(reference, (value, i) => value + now.displacement[i]!);
    worker.postMessage({ shape: request.shape, reference: reference.slice(), points }, [points.buffer]);
    return;
  }
  const displacement = surface.displacement(request.wished);
  const points = new Float32Array(displacement.length);
  const ways = new Float64Array(displacement.length / 3);
  let largest = 0;
  for (let i = 0; i < displacement.length; i += 3) {
    let squared = 0;
    for (let k = i; k < i + 3; k++) {
      points[k] = reference[k]! + displacement[k]!;
      squared += (displacement[k]! - now.displacement[k]!) ** 2;
    }
    ways[i / 3] = squared;
    largest = Math.max(largest, squared);
  }
  const moved = new Array<number>(faces.count).fill(0);
  faces.features.forEach((feature, triangle) => {
    for (let k = 3 * triangle; k < 3 * triangle + 3; k++) moved[feature] = Math.max(moved[feature] ?? 0, ways[faces.triangles[k]!]!);
  });
  const nodes = skeleton && nodesOf(skeleton, displacement);
  worker.postMessage({ number: request.number, points, nodes, largest: Math.sqrt(largest), moved: moved.map(Math.sqrt), size, milliseconds: performance.now() - start }, [points.buffer]);
}

/** The diagonal of the box around points. */
function diagonal(points: Float64Array): number {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  points.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3]!, value);
    high[i % 3] = Math.max(high[i % 3]!, value);
  });
  return points.length === 0 ? 0 : Math.hypot(high[0]! - low[0]!, high[1]! - low[1]!, high[2]! - low[2]!);
}

/** The nodes of a skeleton, each moved by the mean of what the vertices that it carries have moved. */
function nodesOf({ nodes, nodeOfVertex }: SkeletonDescription, displacement: Float64Array): Float32Array {
  const moved = new Float64Array(nodes.length);
  const carried = new Uint32Array(nodes.length / 3);
  nodeOfVertex.forEach((node, vertex) => {
    carried[node]!++;
    for (let k = 0; k < 3; k++) moved[3 * node + k]! += displacement[3 * vertex + k]!;
  });
  return Float32Array.from(nodes, (value, i) => value + moved[i]! / Math.max(1, carried[Math.floor(i / 3)]!));
}

/** The feature that most of the triangles which each curve carries belong to. */
function featuresOf({ nodes, curves, nodeOfVertex }: SkeletonDescription): (string | null)[] {
  const curveOfNode = new Int32Array(nodes.length / 3).fill(-1);
  curves.forEach((curve, number) => { for (const node of curve) curveOfNode[node] = number; });
  const counts = curves.map(() => new Uint32Array(faces.count));
  faces.features.forEach((feature, triangle) => {
    const curve = curveOfNode[nodeOfVertex[faces.triangles[3 * triangle]!]!]!;
    if (curve >= 0) counts[curve]![feature]!++;
  });
  return counts.map((count) => {
    const most = Math.max(0, ...count);
    return most === 0 ? null : featureNames[count.indexOf(most)] ?? null;
  });
}

// One after the other: an answer is there before the next question is looked at.
let last = Promise.resolve();
worker.onmessage = ({ data }) => {
  if ("module" in data) {
    const instance = new Kernel(data.module);
    instance.rehearse();
    loaded(instance);
    return;
  }
  last = last.then(() => answer(data)).catch((error: unknown) => {
    const kind = error instanceof KernelError ? error.kind : "trap";
    const which = "number" in data ? { number: data.number } : "check" in data ? { number: data.check }
      : "skeleton" in data ? { skeleton: data.skeleton } : "shape" in data ? { shape: data.shape } : { id: data.id };
    worker.postMessage({ ...which, kind, error: error instanceof Error ? error.message : String(error) }, []);
  });
};
