import { describe, expect, it } from "vitest";
import { Decoder, MOST_WAITING } from "../../src/connection/decoder";
import type { DecodeWorker } from "../../src/connection/decoder";
import type { DataFrame, Frame } from "../../src/connection/protocol";

const frame = (cycle: number): DataFrame => ({ kind: "data", view: "a", topology: "t", cycle, time: 0, points: new Float32Array(0), fields: [] });

function setUp() {
  const waiting: ArrayBuffer[] = [];
  const worker: DecodeWorker = { onmessage: null, postMessage: (message) => waiting.push(message) };
  const frames: Frame[] = [], counts: number[] = [], lost: string[] = [];
  const decoder = new Decoder(worker, { frame: (read) => frames.push(read), decoded: (count) => counts.push(count), lost: (reason) => lost.push(reason) });
  /** Answers with a frame whose cycle is the first byte of the message. */
  const work = (): void => {
    const cycle = new Uint8Array(waiting.shift()!)[0]!;
    worker.onmessage?.({ data: cycle === 255 ? { error: "broken" } : { frames: [frame(cycle)] } } as MessageEvent);
  };
  return { decoder, frames, counts, lost, waiting, work };
}
const message = (cycle: number): ArrayBuffer => Uint8Array.of(cycle).buffer;
const cycles = (frames: Frame[]): number[] => frames.flatMap((read) => (read.kind === "data" ? [read.cycle] : []));

describe("the queue in front of the decoder", () => {
  it("keeps every frame and their order, one at a time, and counts them", () => {
    const { decoder, frames, counts, waiting, work } = setUp();
    for (let cycle = 1; cycle <= 5; cycle++) decoder.push(message(cycle));
    expect(waiting).toHaveLength(1);
    while (waiting.length) work();
    expect(cycles(frames)).toEqual([1, 2, 3, 4, 5]);
    expect(counts).toEqual([1, 2, 3, 4, 5]);
  });

  it("says that a frame cannot be read, and does not count it", () => {
    const { decoder, counts, lost, waiting, work } = setUp();
    decoder.push(message(255));
    decoder.push(message(2));
    while (waiting.length) work();
    expect(lost).toEqual(["broken"]);
    expect(counts).toEqual([1]);
  });

  it("does not let frames pile up where none is decoded, and says so", () => {
    const { decoder, lost, waiting } = setUp();
    // Only how long it is counts.
    const large = { byteLength: MOST_WAITING / 4 } as ArrayBuffer;
    for (let pushed = 0; pushed < 5; pushed++) decoder.push(large);
    expect(lost).toEqual([]);
    decoder.push(large);
    expect(lost).toEqual(["more than 512 MiB of frames wait to be decoded"]);
    for (let pushed = 0; pushed < 4; pushed++) decoder.push(large);
    expect([lost.length, waiting.length]).toEqual([1, 1]);
  });

  it("forgets what an ended connection left behind, and counts from the start", () => {
    const { decoder, frames, counts, waiting, work } = setUp();
    decoder.push(message(1));
    decoder.push(message(2));
    decoder.clear();
    decoder.push(message(3));
    while (waiting.length) work();
    expect(cycles(frames)).toEqual([3]);
    expect(counts).toEqual([1]);
  });
});
