import { describe, expect, it } from "vitest";
import { Preview } from "../../src/preview/preview";
import type { PreviewWorker } from "../../src/preview/preview";
import type { PreviewAnswer, PreviewRequest } from "../../src/preview/preview.worker";

const A = { id: "a", vertices: 4, faces: 2 };
const edit = (by: number) => [{ translate: { by } }];
const settled = () => new Promise((resolve) => setTimeout(resolve, 0));

function setUp(fetchSurface = async () => new ArrayBuffer(8)) {
  const asked: PreviewRequest[] = [];
  const heard: string[] = [];
  let fetched = 0;
  const worker: PreviewWorker = { onmessage: null, postMessage: (request) => asked.push(request) };
  const preview = new Preview(worker, () => {
    fetched++;
    return fetchSurface();
  }, {
    surface: () => heard.push("surface"), shape: ({ largest }) => heard.push(`shape ${largest}`),
    points: (reference) => heard.push(`points ${reference.length / 3}`), noPoints: (reason) => heard.push(`no points: ${reason}`), checked: (faults) => heard.push(`checked ${faults?.text ?? "sound"}`),
    skeleton: (bones, reason) => heard.push(bones ? `skeleton ${bones.free.length}` : `no skeleton: ${reason}`),
    failed: (kind, reason) => heard.push(`${kind}: ${reason}`), cleared: () => heard.push("cleared"),
  });
  const answer = (data: PreviewAnswer): void => worker.onmessage?.({ data } as MessageEvent<PreviewAnswer>);
  const opened = (id: string): void => answer({ id, surface: { triangles: new Uint32Array(0), triangleFeatures: new Uint32Array(0), features: [] } });
  const numbers = () => asked.flatMap((request) => ("number" in request ? [request] : []));
  /** Answers the newest question with the amount that it asked for. */
  const work = (): void => {
    const { number, wished } = numbers().at(-1)!;
    const largest = (wished as { translate: { by: number } }[])[0]!.translate.by;
    answer({ number, points: new Float32Array(0), nodes: null, largest, moved: [], size: 1, milliseconds: 1 });
  };
  return { preview, asked, heard, answer, opened, numbers, work, fetched: () => fetched };
}

describe("the preview", () => {
  it("asks for the surface when it is first needed, and once", async () => {
    const { preview, heard, opened, numbers, work, fetched } = setUp();
    preview.show([], edit(1));
    preview.offer(A);
    heard.length = 0;
    await settled();
    expect(fetched()).toBe(0);
    preview.show([], edit(2));
    preview.show([], edit(3));
    await settled();
    expect(numbers().length).toBe(0);
    opened("a");
    expect(numbers().map(({ wished }) => wished)).toEqual([edit(3)]);
    work();
    preview.offer({ ...A });
    preview.show([], edit(4));
    work();
    expect(heard).toEqual(["surface", "shape 3", "shape 4"]);
    expect(fetched()).toBe(1);
  });

  it("has the surface ready where it was prepared, and says nothing where that fails before anything is wished for", async () => {
    const ready = setUp();
    ready.preview.offer(A);
    ready.preview.prepare();
    ready.preview.prepare();
    await settled();
    ready.opened("a");
    ready.preview.show([], edit(1));
    ready.work();
    expect(ready.heard).toEqual(["cleared", "surface", "shape 1"]);
    expect(ready.fetched()).toBe(1);
    const failing = setUp(async () => { throw new Error("gone"); });
    failing.preview.offer(A);
    failing.preview.prepare();
    await settled();
    expect(failing.heard).toEqual(["cleared"]);
    failing.preview.show([], edit(1));
    await settled();
    expect(failing.heard).toEqual(["cleared", "surface-missing: gone"]);
  });

  it("computes the newest wish only, one at a time, and shows nothing that was taken away", async () => {
    const { preview, heard, opened, numbers, work } = setUp();
    preview.offer(A);
    preview.show([], edit(1));
    await settled();
    opened("a");
    heard.length = 0;
    for (const by of [2, 3, 4]) preview.show([], edit(by));
    expect(numbers().length).toBe(1);
    work();
    expect(numbers().map(({ wished }) => wished)).toEqual([edit(1), edit(4)]);
    preview.clear();
    work();
    expect(heard).toEqual(["shape 1", "cleared"]);
    preview.show([], edit(5));
    work();
    expect(heard.at(-1)).toBe("shape 5");
  });

  it("looks at the shape at which the hand rests", async () => {
    const { preview, heard, asked, answer, opened, work } = setUp();
    preview.offer(A);
    preview.show([], edit(1));
    await settled();
    opened("a");
    work();
    preview.show([], edit(2));
    work();
    await new Promise((resolve) => setTimeout(resolve, 200));
    const checks = asked.filter((request) => "check" in request);
    expect(checks.length).toBe(1);
    answer({ check: checks[0]!.check, faults: { text: "it folds", triangles: Uint32Array.from([1]) } });
    expect(heard.slice(-2)).toEqual(["shape 2", "checked it folds"]);
  });

  it("looks at the shape now and then while the hand goes on", async () => {
    const { preview, heard, asked, answer, opened, work } = setUp();
    preview.offer(A);
    preview.show([], edit(1));
    await settled();
    opened("a");
    const end = performance.now() + 600;
    for (let by = 2; performance.now() < end; by++) {
      preview.show([], edit(by));
      if ("check" in asked.at(-1)!) answer({ check: (asked.at(-1) as { check: number }).check, faults: { text: "it folds", triangles: new Uint32Array(0) } });
      work();
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
    const looks = heard.filter((word) => word === "checked it folds").length;
    expect(looks).toBeGreaterThanOrEqual(1);
    expect(looks).toBeLessThanOrEqual(3);
  });

  it("gives the points of the surface", async () => {
    const { preview, heard, asked, answer, opened } = setUp();
    preview.surfacePoints([]);
    preview.offer(A);
    preview.surfacePoints(edit(1));
    await settled();
    opened("a");
    expect(asked.at(-1)).toEqual({ shape: "a", stack: edit(1) });
    answer({ shape: "b", reference: new Float64Array(3), points: new Float32Array(3) });
    answer({ shape: "a", reference: new Float64Array(12), points: new Float32Array(12) });
    expect(heard.filter((word) => word.startsWith("points"))).toEqual(["points 4"]);
  });

  it("asks for another surface when the server measures shapes from another one", async () => {
    const { preview, heard, asked, opened, work, fetched } = setUp();
    preview.offer(A);
    preview.show([], edit(1));
    await settled();
    preview.offer({ ...A, id: "b" });
    preview.show([], edit(2));
    await settled();
    opened("a");
    expect(asked.every((request) => "id" in request)).toBe(true);
    opened("b");
    work();
    expect(heard.at(-1)).toBe("shape 2");
    expect(fetched()).toBe(2);
  });

  it("says why there is none, and tries again with the next change", async () => {
    let there = false;
    const { preview, heard, opened, work, answer } = setUp(async () => {
      if (!there) throw new Error("no such file");
      return new ArrayBuffer(8);
    });
    preview.offer(A);
    preview.show([], edit(1));
    await settled();
    expect(heard.at(-1)).toBe("surface-missing: no such file");
    there = true;
    preview.show([], edit(2));
    await settled();
    answer({ id: "a", kind: "frame", error: "cut short" });
    expect(heard.at(-1)).toBe("frame: cut short");
    preview.show([], edit(3));
    await settled();
    opened("a");
    work();
    expect(heard.at(-1)).toBe("shape 3");
  });

  it("asks for the skeleton once the surface is there, and says why there is none", async () => {
    const { preview, asked, heard, answer, opened, fetched } = setUp();
    preview.skeleton([]);
    expect(heard).toEqual(["no skeleton: the simulation has no reference surface"]);
    preview.offer(A);
    preview.skeleton(edit(1));
    preview.skeleton(edit(2));
    await settled();
    expect(asked.some((request) => "skeleton" in request)).toBe(false);
    opened("a");
    expect(asked.at(-1)).toEqual({ skeleton: "a", stack: edit(2) });
    heard.length = 0;
    answer({ skeleton: "b", kind: "skeleton", error: "of another surface" });
    answer({ skeleton: "a", bones: { reference: new Float64Array(9), now: new Float32Array(9), preview: null, segments: Uint32Array.of(0, 1, 1, 2), free: Uint32Array.of(1), curves: [], features: [] } });
    preview.skeleton([]);
    answer({ skeleton: "a", kind: "skeleton", error: "it is flat" });
    expect(heard).toEqual(["skeleton 1", "no skeleton: it is flat"]);
    expect(fetched()).toBe(1);
    // It is no preview that fails.
    const failing = setUp(async () => { throw new Error("gone"); });
    failing.preview.offer(A);
    failing.preview.skeleton([]);
    await settled();
    expect(failing.heard).toEqual(["cleared", "no skeleton: gone"]);
  });
});
