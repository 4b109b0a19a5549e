/** Decodes frames away from the thread that draws. */
import { decodeFrame } from "./protocol";
import type { Frame } from "./protocol";

export type DecodeAnswer = { frame: Frame } | { error: string };

const worker = self as unknown as {
  onmessage: ((event: MessageEvent<ArrayBuffer>) => void) | null;
  postMessage(answer: DecodeAnswer, transfer: Transferable[]): void;
};

worker.onmessage = (event) => {
  try {
    const frame = decodeFrame(new Uint8Array(event.data));
    const arrays = frame.kind === "topology"
      ? [frame.triangles, frame.lines, frame.triangleFeatures]
      : [frame.points, ...frame.fields.map((field) => field.values)];
    const buffers = arrays.flatMap((array) => (array ? [array.buffer as ArrayBuffer] : []));
    worker.postMessage({ frame }, buffers);
  } catch (error) {
    worker.postMessage({ error: error instanceof Error ? error.message : String(error) }, []);
  }
};
