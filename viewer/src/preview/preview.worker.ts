/** Computes previews of edits away from the thread that draws. */
import { Kernel, KernelError } from "../kernel/kernel";
import type { FailureKind, KernelSurface, ShapeFaults, SkeletonDescription, SurfaceDescription } from "../kernel/kernel";
import type { Json } from "../connection/protocol";
import { segmentsOf } from "../picture/skeleton";
import type { Bones } from "../picture/skeleton";

/** The module, once. */
type PreviewModule = { module: WebAssembly.Module };

export type PreviewRequest =
  /** A reference surface, as the server sends it. */
  | { id: string; surface: ArrayBuffer }
  /** The edits that the shape has now, and those to be previewed with them. */
  | { number: number; stack: Json[]; edits: Json[] }
  /** Whether the shape of the last preview is sound. */
  | { check: number }
  /** The skeleton of the surface that is open, and where these edits have brought it. */
  | { skeleton: string; stack: Json[] };

export type PreviewAnswer =
  | { id: string; surface: Pick<SurfaceDescription, "triangles" | "triangleFeatures" | "features"> }
  | { number: number; points: Float32Array; largest: number; milliseconds: number }
  | { check: number; faults: ShapeFaults | null }
  | { skeleton: string; bones: Bones }
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
/** The displacement that the shape has now, and the stack that it is of. */
let now: { stack: string; displacement: Float64Array } = { stack: "", displacement: new Float64Array(0) };

async function answer(request: PreviewRequest): Promise<void> {
  if ("surface" in request) {
    surface?.close();
    surface = null;
    surface = (await kernel).openSurface(new Uint8Array(request.surface));
    const { points, triangles, triangleFeatures, features } = surface.describe();
    reference = points;
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
    const bones = bonesOf(surface.skeleton(), now.displacement);
    worker.postMessage({ skeleton: request.skeleton, bones }, []);
    return;
  }
  const displacement = surface.displacement([...request.stack, ...request.edits]);
  const points = new Float32Array(displacement.length);
  let largest = 0;
  for (let i = 0; i < displacement.length; i += 3) {
    let squared = 0;
    for (let k = i; k < i + 3; k++) {
      points[k] = reference[k]! + displacement[k]!;
      squared += (displacement[k]! - now.displacement[k]!) ** 2;
    }
    largest = Math.max(largest, squared);
  }
  worker.postMessage({ number: request.number, points, largest: Math.sqrt(largest), milliseconds: performance.now() - start }, [points.buffer]);
}

/** A skeleton, each node moved by the mean of what the vertices that it carries have moved. */
function bonesOf({ nodes, curves, nodeOfVertex }: SkeletonDescription, displacement: Float64Array): Bones {
  const moved = new Float64Array(nodes.length);
  const carried = new Uint32Array(nodes.length / 3);
  nodeOfVertex.forEach((node, vertex) => {
    carried[node]!++;
    for (let k = 0; k < 3; k++) moved[3 * node + k]! += displacement[3 * vertex + k]!;
  });
  const now = Float32Array.from(nodes, (value, i) => value + moved[i]! / Math.max(1, carried[Math.floor(i / 3)]!));
  return { reference: nodes, now, ...segmentsOf(curves, carried.length) };
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
      : "skeleton" in data ? { skeleton: data.skeleton } : { id: data.id };
    worker.postMessage({ ...which, kind, error: error instanceof Error ? error.message : String(error) }, []);
  });
};
