import { beforeEach, describe, expect, it, vi } from "vitest";
import type { PreviewAnswer, PreviewRequest } from "../../src/preview/preview.worker";
import { Previewer } from "../../src/preview/previewer";
import type { Scene } from "../../src/picture/scene";
import { page } from "../page";

/** Stands in for the thread that computes. */
class StandIn {
  static last: StandIn;
  onmessage: ((event: MessageEvent<PreviewAnswer>) => void) | null = null;
  readonly asked: PreviewRequest[] = [];
  private failed: (event: { message: string }) => void = () => undefined;
  constructor() { StandIn.last = this; }
  postMessage(request: PreviewRequest): void { this.asked.push(request); }
  addEventListener(_: string, failed: (event: { message: string }) => void): void { this.failed = failed; }
  answer(data: PreviewAnswer): void { this.onmessage?.({ data } as MessageEvent<PreviewAnswer>); }
  fail(message: string): void { this.failed({ message }); }
}

const scene = { setPreview: () => undefined, setPreviewSurface: () => undefined, shownBones: null } as unknown as Scene;

beforeEach(() => {
  vi.stubGlobal("Worker", StandIn);
  vi.stubGlobal("fetch", async () => new Response(new ArrayBuffer(8)));
  return () => vi.unstubAllGlobals();
});

describe("what is wrong with a shape", () => {
  it("is told with the features that have it", async () => {
    const { store } = page();
    new Previewer(scene, "surface", Promise.resolve({} as WebAssembly.Module), store).prepare();
    await new Promise((resolve) => setTimeout(resolve, 0));
    StandIn.last.answer({ id: "s", surface: { triangles: new Uint32Array(9), triangleFeatures: Uint32Array.from([0, 1, 9]), features: ["wall", "throat"] } });
    const told = (...triangles: number[]): readonly string[] => {
      StandIn.last.answer({ check: 99, faults: { text: "it folds", triangles: Uint32Array.from(triangles) } });
      expect(store.state.preview.faults).toBe("it folds");
      return store.state.preview.brokenIn;
    };
    expect([told(1), told(0, 1), told(1, 2)]).toEqual([["throat"], ["wall", "throat"], []]);
  });
});

describe("the points of the surface, for a file", () => {
  const SURFACE = { id: "s", surface: { triangles: new Uint32Array(3), triangleFeatures: new Uint32Array(1), features: ["wall"] } };
  const points = (): PreviewAnswer => ({ shape: "s", reference: new Float64Array(9), points: new Float32Array(9) });
  const settled = () => new Promise((resolve) => setTimeout(resolve, 0));
  let made: ReturnType<typeof page>;
  let previewer: Previewer;
  const said: string[] = [];
  const ask = (): void => void previewer.surfaceNow().then(({ points: found }) => said.push(`${found.length / 3} points`), (error: Error) => said.push(error.message));

  beforeEach(() => {
    made = page();
    previewer = new Previewer(scene, "surface", Promise.resolve({} as WebAssembly.Module), made.store);
    said.length = 0;
  });

  it("come once for each who asks", async () => {
    ask();
    ask();
    await settled();
    StandIn.last.answer(SURFACE);
    StandIn.last.answer(points());
    StandIn.last.answer(points());
    await settled();
    expect(said).toEqual(["3 points", "3 points"]);
  });

  it("are refused where the surface cannot be read, and do not come later by surprise", async () => {
    ask();
    await settled();
    StandIn.last.answer({ id: "s", kind: "surface", error: "it is torn" });
    await settled();
    expect(said).toEqual(["it is torn"]);
    made.store.dispatch({ type: "stack", edits: [{ translate: {} }], undoable: 1 });
    StandIn.last.answer(SURFACE);
    StandIn.last.answer(points());
    await settled();
    expect(said).toEqual(["it is torn"]);
  });

  it("are refused where they cannot be fetched or computed, where the thread fails, and where there is another surface", async () => {
    vi.stubGlobal("fetch", async () => { throw new Error("gone"); });
    ask();
    await settled();
    vi.stubGlobal("fetch", async () => new Response(new ArrayBuffer(8)));
    ask();
    await settled();
    StandIn.last.answer(SURFACE);
    StandIn.last.answer({ shape: "s", kind: "edit", error: "no such feature" });
    ask();
    StandIn.last.fail("out of memory");
    ask();
    made.greet({ surface: { id: "t", vertices: 3, faces: 1 } });
    await settled();
    expect(said).toEqual(["gone", "no such feature", "out of memory", "the simulation has another surface now"]);
  });

  it("are refused where there is no surface", async () => {
    made.greet({ surface: null });
    ask();
    await settled();
    expect(said).toEqual(["the simulation has no reference surface"]);
  });
});
