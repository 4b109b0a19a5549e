/** Decodes frames away from the thread that draws. */
import { Kernel } from "../kernel/kernel";
import type { Frame } from "./protocol";

/** The module, once, and messages, one at a time. */
export type DecodeRequest = { module: WebAssembly.Module } | ArrayBuffer;
export type DecodeAnswer = { frames: Frame[] } | { error: string };

const worker = self as unknown as {
  onmessage: ((event: MessageEvent<DecodeRequest>) => void) | null;
  postMessage(answer: DecodeAnswer, transfer: Transferable[]): void;
};

let loaded: (kernel: Kernel) => void;
const kernel = new Promise<Kernel>((resolve) => { loaded = resolve; });

async function decode(message: ArrayBuffer): Promise<void> {
  try {
    const frames = (await kernel).decodeFrame(new Uint8Array(message));
    const arrays = frames.flatMap((frame): (Uint32Array | Float32Array | Float64Array | null)[] => frame.kind === "topology"
      ? [frame.triangles, frame.lines, frame.triangleFeatures] : [frame.points, ...frame.fields.map((field) => field.values)]);
    const buffers = arrays.flatMap((array) => (array ? [array.buffer as ArrayBuffer] : []));
    worker.postMessage({ frames }, buffers);
  } catch (error) {
    worker.postMessage({ error: error instanceof Error ? error.message : String(error) }, []);
  }
}

// One answer is awaited before the next message is sent, so that they are decoded in their order.
worker.onmessage = ({ data }) => {
  if (data instanceof ArrayBuffer) void decode(data);
  else loaded(new Kernel(data.module));
};
