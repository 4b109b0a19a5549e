import { describe, expect, it } from "vitest";
import { MAXIMUM_FRAME_BYTES, ProtocolError, decodeFrame, peekFrame } from "../src/protocol";
import type { DataFrame, TopologyFrame } from "../src/protocol";
import { concat, dataFrame, delta, frame, planar, topologyFrame, zstd } from "./frames.mjs";

/** 2000 bytes, i * 7 % 31 + i / 256, compressed by the zstd program: with its size and checksum, and streamed without either. */
const COMPRESSED = [
  "KLUv/WTQBrUCAJQCAAcOFRwECxIZAQgPFh0FDBMaAgkQFx4GDRQbAwoRGB8gIQkiIyQlDRQUoDBz6/8GgOMeLkHJZCkKwih18SGJSvQnXpF6w6ISwkIFFLhFiTx7BSVl89+EZg==",
  "KLUv/QBY7QIAZAIABw4VHAQLEhkBCA8WHQUMExoCCRAXHgYNFBsDChEYHyAhIiMkJRYAEkABEA8wkQUUAHFAiCigAIgHjkgCCoB44IsgoACIB+7AAgqAOIAFFFAA4smNHPYKSjkB",
].map((text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)));
const ORIGINAL = Array.from({ length: 2000 }, (_, i) => ((i * 7) % 31) + Math.floor(i / 256));

const points = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1];
const data = (fields: Parameters<typeof dataFrame>[4]): DataFrame => decodeFrame(dataFrame("v", "t", 7, 0.5, fields)) as DataFrame;

/** A data frame of one array whose header is changed after the fact. */
function altered(change: object, blob = zstd(Uint8Array.from([1, 2, 3, 4]))): Uint8Array {
  const array = { name: "p", association: "vertex", components: 1, count: 4, type: "u8", quantum: [1], offset: [0], filter: "none", range: [1, 4], bytes: blob.length, ...change };
  return frame(2, { view: "v", topology: "t", cycle: 1, time: 0, arrays: [array] }, [blob]);
}
const complaint = (bytes: Uint8Array): string => {
  try {
    decodeFrame(bytes);
  } catch (error) {
    expect(error).toBeInstanceOf(ProtocolError);
    return (error as Error).message;
  }
  throw new Error("the frame was accepted");
};

describe("a topology frame", () => {
  it("is read", () => {
    const bytes = topologyFrame("surface", "9f", 4, [0, 1, 2, 0, 3, 1], [5, 2], [2, 3]);
    expect(peekFrame(bytes)).toEqual({ kind: "topology", view: "surface" });
    const topology = decodeFrame(bytes) as TopologyFrame;
    expect(topology).toMatchObject({ kind: "topology", view: "surface", topology: "9f", points: 4 });
    expect([...topology.triangles]).toEqual([0, 1, 2, 0, 3, 1]);
    expect([...topology.triangleFeatures!]).toEqual([5, 2]);
    expect([...topology.lines]).toEqual([2, 3]);
  });

  it("may not name points that are not there, nor leave triangles without a feature", () => {
    expect(complaint(topologyFrame("s", "t", 3, [0, 1, 3]))).toMatch(/point 3 of 3/);
    expect(complaint(topologyFrame("s", "t", 3, [0, 1, 2], [0, 0]))).toMatch(/2 triangle features for 1 triangles/);
  });
});

describe("a data frame", () => {
  it("is read within its quantum, whatever the type and filter", () => {
    for (const type of ["u8", "u16", "u32"] as const) {
      for (const filter of ["delta", "none"]) {
        const values = Array.from({ length: 300 }, (_, i) => Math.sin(i) * 10 - 4);
        const field = data([{ name: "points", components: 3, values: points }, { name: "f", components: 3, values, type, filter }]).fields[0]!;
        const quantum = 20 / (2 ** { u8: 8, u16: 16, u32: 32 }[type] - 1);
        field.values.forEach((value, i) => expect(Math.abs(value - values[i]!)).toBeLessThan(quantum / 2 + 2e-6));
      }
    }
  });

  it("is read exactly where it holds the numbers themselves", () => {
    const read = data([{ name: "points", components: 3, values: points, type: "f64" }, { name: "p", association: "element", components: 1, values: [1.5, -2], type: "f32" }]);
    expect([...read.points!]).toEqual(points);
    expect(read.fields[0]).toMatchObject({ name: "p", association: "element", components: 1 });
    expect([...read.fields[0]!.values]).toEqual([1.5, -2]);
    expect(read).toMatchObject({ cycle: 7, time: 0.5, view: "v", topology: "t" });
  });

  it("wraps around in the type of the array", () => {
    for (const [type, integers] of [["u8", [255, 0, 128, 127, 1]], ["u16", [65535, 0, 40000, 3]], ["u32", [4294967295, 0, 2147483648, 2147483647, 7]]] as const) {
      const packed = delta(integers, type);
      const blob = zstd(new Uint8Array(packed.buffer));
      const read = decodeFrame(altered({ count: integers.length, type, filter: "delta", bytes: blob.length }, blob)) as DataFrame;
      expect([...read.fields[0]!.values]).toEqual(integers.map(Math.fround));
    }
  });

  it("reads what the zstd program wrote", () => {
    for (const blob of COMPRESSED) {
      expect([...(decodeFrame(altered({ count: 2000, bytes: blob.length }, blob)) as DataFrame).fields[0]!.values]).toEqual(ORIGINAL);
    }
  });

  it("holds integers that are the values where there is no quantum", () => {
    for (const quantum of [null, undefined]) expect([...(decodeFrame(altered({ quantum, offset: null })) as DataFrame).fields[0]!.values]).toEqual([1, 2, 3, 4]);
  });

  it("may hold nothing", () => {
    expect(data([{ name: "points", components: 3, values: [] }]).points).toHaveLength(0);
    const empty = decodeFrame(altered({ count: 0, bytes: 0 }, new Uint8Array(0))) as DataFrame;
    expect(empty.fields[0]!.values).toHaveLength(0);
  });
});

describe("a broken frame", () => {
  it("is refused wherever it is cut off", () => {
    const whole = dataFrame("v", "t", 1, 0, [{ name: "points", components: 3, values: points }]);
    for (let length = 0; length < whole.length; length++) complaint(whole.slice(0, length));
    complaint(concat([whole, Uint8Array.from([0])]));
  });

  it("is refused by name", () => {
    const good = altered({});
    const bent = (at: number, value: number): Uint8Array => {
      const copy = good.slice();
      copy[at] = value;
      return copy;
    };
    expect(complaint(bent(0, 0x55))).toMatch(/does not begin with TMBL/);
    expect(complaint(bent(4, 2))).toMatch(/version 2/);
    expect(complaint(bent(5, 3))).toMatch(/kind 3/);
    expect(complaint(bent(11, 0xff))).toMatch(/header claims/);
    expect(complaint(bent(12, 0xff))).toMatch(/not JSON/);
    expect(complaint(altered({ count: 5 }))).toMatch(/4 bytes, expected 5/);
    expect(complaint(altered({ count: 3 }))).toMatch(/more than the 3 bytes/);
    expect(complaint(altered({ count: -1 }))).toMatch(/"count" is not a whole number/);
    expect(complaint(altered({ count: 1.5 }))).toMatch(/whole number/);
    expect(complaint(altered({ count: 0xffffffff, components: 64, type: "f64" }))).toMatch(new RegExp(`more than ${MAXIMUM_FRAME_BYTES}`));
    expect(complaint(altered({ components: 0 }))).toMatch(/0 components/);
    expect(complaint(altered({ components: 1e9 }))).toMatch(/components/);
    expect(complaint(altered({ type: "i128" }))).toMatch(/unknown type i128/);
    expect(complaint(altered({ type: "constructor" }))).toMatch(/unknown type/);
    expect(complaint(altered({ bytes: 1e6 }))).toMatch(/truncated/);
    expect(complaint(altered({ filter: "magic" }))).toMatch(/unknown filter/);
    expect(complaint(altered({ quantum: [1, 1] }))).toMatch(/quantum is not a list of 1 numbers/);
    expect(complaint(altered({ offset: ["0"] }))).toMatch(/offset/);
    expect(complaint(altered({ name: "points" }))).toMatch(/1 components, expected 3/);
    expect(complaint(frame(2, { view: "v", topology: "t", cycle: 1, time: 0, arrays: {} }, []))).toMatch(/no list of arrays/);
    expect(complaint(frame(2, { view: 3, topology: "t", cycle: 1, time: 0, arrays: [] }, []))).toMatch(/"view" is not a text/);
    expect(complaint(frame(2, { view: "v", topology: "t", cycle: "1", time: 0, arrays: [] }, []))).toMatch(/cycle/);
    expect(complaint(frame(2, [], []))).toMatch(/not an object/);
    expect(complaint(frame(2, { view: "v", topology: "t", cycle: 1, time: 0, arrays: Array(1000).fill({}) }, []))).toMatch(/1000 arrays/);
  });

  it("cannot make the decoder allocate what it does not need", () => {
    // A window of 3.75 TiB, and a content of 2^60 bytes.
    const window = Uint8Array.from([0x28, 0xb5, 0x2f, 0xfd, 0x00, 0xff, 1, 0, 0]);
    const content = Uint8Array.from([0x28, 0xb5, 0x2f, 0xfd, 0xe0, 0, 0, 0, 0, 0, 0, 0, 0x10, 1, 0, 0]);
    for (const blob of [window, content]) expect(complaint(altered({ bytes: blob.length }, blob))).toMatch(/window is too large/);
  });

  it("never ends in anything but an answer, whatever bits are flipped", () => {
    const blob = COMPRESSED[0]!;
    const good = altered({ count: 2000, bytes: blob.length }, blob);
    let state = 1;
    const random = (): number => (state = (state * 48271) % 2147483647);
    for (let trial = 0; trial < 4000; trial++) {
      const bytes = good.slice();
      const flips = 1 + (random() % 3);
      for (let i = 0; i < flips; i++) bytes[random() % bytes.length]! ^= 1 << (random() % 8);
      try {
        decodeFrame(bytes);
      } catch (error) {
        expect(error).toBeInstanceOf(ProtocolError);
      }
    }
  });

  it("has planes where the protocol has them", () => {
    expect(planar([1, 2, 3, 4, 5, 6], 3)).toEqual([1, 4, 2, 5, 3, 6]);
  });
});
