import { describe, expect, it } from "vitest";
import type { DataFrame, Frame, TopologyFrame } from "../../src/connection/protocol";
import { EarlyFrames } from "../../src/picture/early-frames";

const topology = (view: string, id: string): TopologyFrame => ({ kind: "topology", view, topology: id }) as unknown as TopologyFrame;
const data = (view: string, id: string, cycle: number): DataFrame => ({ kind: "data", view, topology: id, cycle }) as unknown as DataFrame;

describe("frames of views that nobody has told of yet", () => {
  const taken = (frames: Frame[], view: string): Frame[] => {
    const early = new EarlyFrames();
    for (const frame of frames) early.keep(frame);
    return early.take(view);
  };

  it("are there once the view is: its topology, then the newest data on it", () => {
    const frames = [topology("slice", "a"), data("slice", "a", 5), data("slice", "a", 10), topology("other", "b")];
    expect(taken(frames, "slice")).toEqual([frames[0], frames[2]]);
    expect(taken(frames, "other")).toEqual([frames[3]]);
    expect(taken(frames, "nothing")).toEqual([]);
  });

  it("are none of a topology that is no longer the newest, and are handed out once", () => {
    const frames = [topology("slice", "a"), data("slice", "a", 5), topology("slice", "b"), data("slice", "a", 10)];
    expect(taken(frames, "slice")).toEqual([frames[2]]);
    expect(taken([data("slice", "a", 5)], "slice")).toEqual([]);
    const early = new EarlyFrames();
    early.keep(frames[0]!);
    early.take("slice");
    expect(early.take("slice")).toEqual([]);
  });

  it("are kept of so many views, and no more", () => {
    const frames = Array.from({ length: 33 }, (_, i) => topology(`v${i}`, "a"));
    expect([taken(frames, "v0").length, taken(frames, "v1").length, taken(frames, "v32").length]).toEqual([0, 1, 1]);
  });
});
