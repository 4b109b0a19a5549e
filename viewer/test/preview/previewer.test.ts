import { beforeEach, describe, expect, it, vi } from "vitest";
import type { PreviewAnswer, PreviewRequest } from "../../src/preview/preview.worker";
import { Previewer } from "../../src/preview/previewer";
import type { Scene } from "../../src/picture/scene";
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import { Ghost } from "../../src/picture/ghost";
import type { Piece } from "../../src/picture/layer";
import type { Bones } from "../../src/picture/skeleton";
import type { PreviewSurface } from "../../src/preview/preview";
import { page } from "../page";

/** Stands in for the thread that computes. */
class StandIn {
  static last: StandIn;
  onmessage: ((event: MessageEvent<PreviewAnswer>) => void) | null = null;
  readonly asked: PreviewRequest[] = [];
  private failed: (event: { message: string }) => void = () => undefined;
  constructor() { StandIn.last = this; }
  postMessage(request: PreviewRequest): void { this.asked.push(request); }
  isEnded = false;
  terminate(): void { this.isEnded = true; }
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

describe("what is seen of a shape while a hand makes it", () => {
  const SURFACE: PreviewAnswer = { id: "s", surface: { triangles: Uint32Array.of(0, 1, 2, 0, 2, 3), triangleFeatures: Uint32Array.of(0, 1), features: ["wall", "throat"] } };
  const BONES: Bones = { reference: Float64Array.of(0, 0, 0, 1, 0, 0), now: Float32Array.of(0, 0, 0, 1, 0, 0), preview: null, segments: Uint32Array.of(0, 1), free: new Uint32Array(0), curves: [Uint32Array.of(0, 1)], features: [null] };
  const settled = () => new Promise((resolve) => setTimeout(resolve, 0));
  let made: ReturnType<typeof page>;
  let previewer: Previewer;
  let ghost: Ghost;
  let bones: Bones | null;
  /** The triangles that are drawn as broken; none where they are not seen. */
  const broken = (): number[] => {
    const { actor, data } = (ghost as unknown as { broken: Piece }).broken;
    return actor.getVisibility() ? [...data.getPolys().getData()] : [];
  };
  const last = (key: "number" | "check"): number => StandIn.last.asked.flatMap((request) => (key in request ? [(request as Record<typeof key, number>)[key]] : [])).at(-1)!;
  /** The hand asks for a shape, and it comes. */
  const drag = (by: number): Float32Array => {
    wish(by);
    return come(by);
  };
  const wish = (by: number): void => made.store.dispatch({ type: "composed", key: "translate", values: { by: [by, 0, 0] }, step: "drag" });
  const come = (by: number): Float32Array => {
    const points = new Float32Array(12).fill(by);
    StandIn.last.answer({ number: last("number"), points, nodes: Float32Array.of(by, 0, 0, 1 + by, 0, 0), largest: by, moved: [by, 0], size: 1, milliseconds: 1 });
    return points;
  };
  const judge = (...triangles: number[]): void => StandIn.last.answer({ check: last("number"), faults: triangles.length > 0 ? { text: "it folds", triangles: Uint32Array.from(triangles) } : null });

  beforeEach(async () => {
    ghost = new Ghost(vtkRenderer.newInstance());
    bones = null;
    const picture = {
      setPreviewSurface: (surface: PreviewSurface) => ghost.setSurface(surface),
      setPreview: (points: Float32Array | null, faults?: Uint32Array, drawn?: () => void) => {
        ghost.setPoints(points, faults);
        drawn?.();
      },
      setBones: (shown: Bones | null) => { bones = shown; },
      get shownBones() { return bones; },
    } as unknown as Scene;
    made = page();
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    previewer = new Previewer(picture, "surface", Promise.resolve({} as WebAssembly.Module), made.store);
    previewer.prepare();
    await settled();
    StandIn.last.answer(SURFACE);
  });

  it("is coloured where it is broken, also in the shapes that come until the next look", () => {
    drag(1);
    expect([ghost.coordinates?.[0], broken()]).toEqual([1, []]);
    judge(1);
    expect([broken(), made.store.state.preview.brokenIn]).toEqual([[3, 0, 2, 3], ["throat"]]);
    drag(2);
    expect([ghost.coordinates?.[0], broken()]).toEqual([2, [3, 0, 2, 3]]);
    judge(0);
    expect(broken()).toEqual([3, 0, 1, 2]);
    drag(3);
    judge();
    expect([ghost.coordinates?.[0], broken(), made.store.state.preview.faults]).toEqual([3, [], ""]);
  });

  it("moves what it moved, until the shape of another amount has come, and for all one knows anything by another handle", () => {
    const known = (): unknown => [made.store.state.preview.state, made.store.state.preview.moved];
    const ask = (by: number): void => made.store.dispatch({ type: "composed", key: "translate", values: { by: [by, 0, 0] }, step: "drag" });
    ask(1);
    expect(known()).toEqual(["waiting", null]);
    drag(2);
    expect(known()).toEqual(["waiting", null]);
    StandIn.last.answer({ number: last("number"), points: new Float32Array(12), nodes: null, largest: 2, moved: [2, 0], size: 1, milliseconds: 1 });
    expect(known()).toEqual(["shown", { wall: 2, throat: 0 }]);
    ask(3);
    expect(known()).toEqual(["waiting", { wall: 2, throat: 0 }]);
    made.store.dispatch({ type: "part", feature: "wall", part: "fixed" });
    expect(known()).toEqual(["waiting", null]);
  });

  it("begins sound again after what was broken is given up", () => {
    drag(1);
    judge(1);
    made.store.dispatch({ type: "cleared" });
    expect([ghost.coordinates, broken()]).toEqual([null, []]);
    drag(2);
    expect([ghost.coordinates?.[0], broken()]).toEqual([2, []]);
  });

  it("stays where there is no skeleton, and that is told by itself", () => {
    const reasons: string[] = [];
    previewer.noSkeleton = (reason) => reasons.push(reason);
    drag(1);
    previewer.showSkeleton(true);
    StandIn.last.answer({ skeleton: "s", kind: "skeleton", error: "it is a sheet" });
    expect([reasons, ghost.coordinates?.[0], made.store.state.preview.state, bones]).toEqual([["it is a sheet"], 1, "shown", null]);
    previewer.showSkeleton(true);
    StandIn.last.fail("out of memory");
    expect([reasons[1], made.store.state.preview.reason]).toEqual(["out of memory", "out of memory"]);
    // Nobody waits for one any more.
    made.store.dispatch({ type: "stack", edits: [{ translate: {} }], undoable: 1 });
    expect(StandIn.last.asked.some((request) => "skeleton" in request && request.stack.length > 0)).toBe(false);
  });

  it("fails with the thread that computes it, and comes of another one with the next wish", async () => {
    const first = StandIn.last;
    wish(1);
    expect(made.store.state.preview.state).toBe("waiting");
    first.fail("out of memory");
    expect([made.store.state.preview.state, made.store.state.preview.reason, first.isEnded, StandIn.last === first]).toEqual(["failed", "out of memory", true, true]);
    wish(2);
    await settled();
    StandIn.last.answer(SURFACE);
    come(2);
    expect([made.store.state.preview.state, ghost.coordinates?.[0], StandIn.last === first]).toEqual(["shown", 2, false]);
    // What comes late of the first is nothing.
    first.fail("again");
    expect(made.store.state.preview.state).toBe("shown");
  });

  it("has the skeleton in it, which goes back with what is given up", () => {
    previewer.showSkeleton(true);
    StandIn.last.answer({ skeleton: "s", bones: BONES });
    expect(bones?.preview).toBeNull();
    drag(1);
    expect([...bones!.preview!]).toEqual([1, 0, 0, 2, 0, 0]);
    expect([bones!.now, bones!.curves]).toEqual([BONES.now, BONES.curves]);
    drag(2);
    expect([...bones!.preview!]).toEqual([2, 0, 0, 3, 0, 0]);
    made.store.dispatch({ type: "cleared" });
    expect(bones).toEqual(BONES);
    // One that is not shown follows nothing.
    previewer.showSkeleton(false);
    drag(3);
    expect(bones).toBeNull();
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
