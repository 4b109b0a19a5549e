import { describe, expect, it } from "vitest";
import { Decoder } from "../src/decoder";
import type { DecodeWorker } from "../src/decoder";
import { decodeFrame } from "../src/protocol";
import type { Frame } from "../src/protocol";
import { dataFrame, topologyFrame } from "./frames.mjs";

function setUp() {
  const waiting: ArrayBuffer[] = [];
  const worker: DecodeWorker = { onmessage: null, postMessage: (bytes) => waiting.push(bytes) };
  const frames: Frame[] = [];
  const errors: string[] = [];
  const decoder = new Decoder(worker, (frame) => frames.push(frame), (message) => errors.push(message));
  const work = (): void => {
    const bytes = waiting.shift()!;
    let data: { frame: Frame } | { error: string };
    try {
      data = { frame: decodeFrame(new Uint8Array(bytes)) };
    } catch (error) {
      data = { error: String(error) };
    }
    worker.onmessage?.({ data } as MessageEvent);
  };
  return { decoder, frames, errors, waiting, work };
}
const buffer = (bytes: Uint8Array): ArrayBuffer => bytes.slice().buffer;
const data = (view: string, cycle: number): ArrayBuffer => buffer(dataFrame(view, "t", cycle, 0, [{ name: "points", components: 3, values: [0, 0, 0, 1, 1, 1] }]));
const topology = (view: string): ArrayBuffer => buffer(topologyFrame(view, "t", 2, [0, 1, 1]));

describe("the queue in front of the decoder", () => {
  it("keeps only the newest data of each view, never skips a topology, and keeps their order", () => {
    const { decoder, frames, waiting, work } = setUp();
    decoder.push(topology("a"));
    for (let cycle = 1; cycle <= 5; cycle++) {
      decoder.push(data("a", cycle));
      decoder.push(data("b", cycle));
    }
    decoder.push(topology("a"));
    decoder.push(data("a", 6));
    while (waiting.length) work();
    expect(frames.map((frame) => (frame.kind === "data" ? `${frame.view}${frame.cycle}` : `T${frame.view}`))).toEqual(["Ta", "b5", "Ta", "a6"]);
    expect(decoder.dropped).toBe(9);
  });

  it("reports a broken frame and goes on", () => {
    const { decoder, frames, errors, waiting, work } = setUp();
    decoder.push(new ArrayBuffer(5));
    const broken = new Uint8Array(data("a", 1));
    decoder.push(buffer(broken.subarray(0, broken.length - 4)));
    decoder.push(data("b", 2));
    while (waiting.length) work();
    expect(errors).toHaveLength(2);
    expect(frames).toHaveLength(1);
  });

  it("forgets what an ended connection left behind", () => {
    const { decoder, frames, waiting, work } = setUp();
    decoder.push(data("a", 1));
    decoder.push(data("b", 1));
    decoder.clear();
    decoder.push(data("c", 2));
    while (waiting.length) work();
    expect(frames.map((frame) => frame.view)).toEqual(["c"]);
  });
});
