// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage, Json, Vector } from "../../src/connection/protocol";
import { SlicePanel } from "../../src/panels/slice";
import type { Pipeline } from "../../src/store/pipelines";
import { feature, page } from "../page";

const CUT: Pipeline = { name: "cut", every: { steps: 5 }, stages: [{ slice: { origin: [0, 0, 0.2], normal: [0, 0, 1] } }, { stream: {} }] };

describe("the slice", () => {
  let made: ReturnType<typeof page>;
  let sent: ClientMessage[];
  let seen: [Vector, Vector] | null;
  const root = document.createElement("div");
  const input = (): HTMLInputElement => root.querySelector<HTMLInputElement>('input[type="text"]')!;
  const wrong = (): string => root.querySelector<HTMLElement>(".wrong:not([hidden])")?.textContent ?? "";
  const type = (text: string): void => {
    input().value = text;
    input().dispatchEvent(new Event("change"));
  };
  const wall = { ...feature("wall"), bounds: [[-1, -1, -0.025], [1, 1, 0.025]] as [Vector, Vector] };
  const note = (): string => root.querySelector<HTMLElement>(".hint:not([hidden])")?.textContent ?? "";
  const open = async (features = [wall], slice: Json = CUT.stages[0]!): Promise<void> => {
    made = page({ views: [{ name: "cut", kind: "slice" }], features });
    sent = [];
    seen = [[-1, -1, 0.2], [1, 1, 0.2]];
    const pipelines = new Pipelines(() => Promise.resolve([{ ...CUT, stages: [slice, { stream: {} }] }]), (message) => `m${sent.push(message)}`, () => undefined);
    new SlicePanel(root, made.store, pipelines, () => seen);
    made.store.dispatch({ type: "view chosen", view: "cut" });
    await pipelines.told(0);
  };
  beforeEach(async () => {
    seen = null;
    await open();
    seen = [[-1, -1, 0], [1, 1, 0]];
  });

  it("says where nothing is cut, and sends nothing then", () => {
    expect(root.hidden).toBe(false);
    type("0.3");
    expect(wrong()).toBe("Nothing is cut there: the domain goes from −0.025 to 0.025.");
    expect([sent, input().value, input().getAttribute("aria-invalid")]).toEqual([[], "0.3", "true"]);
    // The ends are the surface, also where a frame has rounded them.
    seen = [[-1, -1, -0.025000000372529], [1, 1, 0.025000000372529]];
    type("-0.025");
    expect([wrong() === "", sent]).toEqual([false, []]);
    type("0.3");
    // What was typed stays beside its reason.
    made.store.dispatch({ type: "status", status: { cycle: 8, time: 0.8, paused: false, stopped: false, viewers: 1, driver: null }, at: 0 });
    expect([input().value, wrong() === ""]).toEqual(["0.3", false]);
    type("far");
    expect(wrong()).toBe("The offset “far” is not a number.");
    type("-0.01");
    expect([wrong(), sent.length, input().getAttribute("aria-invalid")]).toEqual(["", 1, null]);
  });

  it("cuts where the shape has come to that is seen, beyond the features as they were told", () => {
    seen = [[-1, -1, -0.5], [1, 1, 0.5]];
    type("0.3");
    expect([wrong(), sent.length]).toEqual(["", 1]);
    type("0.6");
    expect(wrong()).toBe("Nothing is cut there: the domain goes from −0.5 to 0.5.");
  });

  it("moves several planes that are parallel together, and says so", async () => {
    await open([], { slice: { planes: [0.2, 0.5].map((z) => ({ origin: [0, 0, z], normal: [0, 0, 1] })) } });
    expect([root.hidden, input().value, note()]).toEqual([false, "0.2", "2 planes move together; the offset is that of the first."]);
    type("0.3");
    expect(sent).toMatchObject([{ pipelines: { set: [{ stages: [{ slice: { planes: [{ origin: [0, 0, expect.closeTo(0.3, 12)] }, { origin: [0, 0, expect.closeTo(0.6, 12)] }] } }, { stream: {} }] }] } }]);
  });

  it("says of another one where it is changed, and has nothing there that would move it", async () => {
    await open([], { slice: { sphere: { center: [0, 0, 0], radius: 1 } } });
    expect([root.hidden, note()]).toEqual([false, "This slice is cut by a sphere, not by a plane. It is changed under Pipelines."]);
    expect(root.querySelectorAll(":scope > :not([hidden]) input, :scope > input:not([hidden])").length).toBe(0);
    await open([], { surface: {} });
    expect(root.hidden).toBe(true);
  });

  it("asks the run where nothing tells how far the domain goes", async () => {
    await open([]);
    type("0.6");
    expect([wrong(), sent.length]).toEqual(["", 1]);
  });
});
