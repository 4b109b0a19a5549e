/** The frames that the encoder makes (`pipelines/tests/encode.rs` keeps them up to date), decoded by the module. */
import { readFileSync } from "node:fs";
import { beforeEach, describe, expect, it } from "vitest";
import { Kernel } from "../../src/kernel/kernel";
import { KernelError } from "../../src/kernel/module";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import { wasm } from "../wasm";

interface Expected {
  view: string; topology: string; cycle: number; time: number; points: number[];
  fields: { name: string; association: string; components: number; values: number[] }[];
  cells: { triangles: number[]; lines: number[]; features: number[] | null } | null;
}
const { messages, frames } = JSON.parse(readFileSync(new URL("../frames.json", import.meta.url), "utf8")) as { messages: string[]; frames: Expected[] };
const bytes = messages.map((message) => Uint8Array.from(Buffer.from(message, "hex")));

describe("the decoder of the module", () => {
  let kernel: Kernel;
  beforeEach(() => { kernel = new Kernel(wasm); });

  it("reads the very numbers that went in", () => {
    frames.forEach((expected, index) => {
      const read = kernel.decodeFrame(bytes[index]!);
      const data = read.at(-1) as DataFrame;
      expect(data).toMatchObject({ kind: "data", view: expected.view, topology: expected.topology, cycle: expected.cycle, time: expected.time });
      expect([...data.points]).toEqual(expected.points);
      expect(data.fields.map(({ values, ...field }) => ({ ...field, values: [...values] }))).toEqual(expected.fields);
      expect(read).toHaveLength(expected.cells ? 2 : 1);
      if (!expected.cells) return;
      const topology = read[0] as TopologyFrame;
      expect(topology).toMatchObject({ kind: "topology", view: expected.view, topology: expected.topology, points: expected.points.length / 3 });
      expect([...topology.triangles]).toEqual(expected.cells.triangles);
      expect([...topology.lines]).toEqual(expected.cells.lines);
      expect(topology.triangleFeatures && [...topology.triangleFeatures]).toEqual(expected.cells.features);
    });
  });

  const complaint = (message: Uint8Array): string => {
    try {
      kernel.decodeFrame(message);
    } catch (error) {
      expect(error).toBeInstanceOf(KernelError);
      expect((error as KernelError).kind).toBe("frame");
      return (error as Error).message;
    }
    throw new Error("the frame was accepted");
  };

  it("says what is wrong with a frame", () => {
    const [first, second] = bytes as [Uint8Array, Uint8Array];
    expect(complaint(second)).toMatch(/was not read/);
    const bent = (at: number, value: number): Uint8Array => Uint8Array.from(first, (byte, index) => (index === at ? value : byte));
    expect(complaint(bent(0, 0x55))).toMatch(/does not begin with TMBL/);
    expect(complaint(bent(4, 1))).toMatch(/found version 1, expected 2/);
    expect(complaint(bent(5, 9))).toMatch(/found kind 9/);
    for (let length = 0; length < first.length; length += 7) complaint(first.subarray(0, length));
  });

  it("never ends in anything but an answer, whatever bits are flipped", () => {
    let state = 1;
    const random = (): number => (state = (state * 48271) % 2147483647);
    for (let trial = 0; trial < 1000; trial++) {
      const message = bytes[0]!.slice();
      for (let i = 1 + (random() % 3); i > 0; i--) message[random() % message.length]! ^= 1 << (random() % 8);
      try {
        kernel.decodeFrame(message);
      } catch (error) {
        expect((error as KernelError).kind).toBe("frame");
      }
    }
  });
});
