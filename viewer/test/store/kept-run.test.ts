import { beforeEach, describe, expect, it } from "vitest";
import { KeptRun, LONGEST_HISTORY } from "../../src/store/kept";
import type { KeptOfRun } from "../../src/store/kept";
import type { KeptDraft } from "../../src/store/kept-draft";

describe("what is kept of a run over a reload", () => {
  let stored: Map<string, string>;
  const storage = {
    getItem: (key: string) => stored.get(key) ?? null,
    setItem: (key: string, text: string) => void stored.set(key, text),
    removeItem: (key: string) => void stored.delete(key),
    key: (index: number) => [...stored.keys()][index] ?? null,
    get length() { return stored.size; },
  };
  const PIN = { name: "probe 2", view: "cut", point: [1, 0.5, 0] as [number, number, number] };
  const CAMERA = { position: [0, 0, 3], focalPoint: [0, 0, 0], viewUp: [0, 1, 0], parallel: true, parallelScale: 2, viewAngle: 30, middle: [0.1, 0] } as KeptOfRun["camera"];
  const DRAFT: KeptDraft = {
    key: "translate", body: { by: [1, 0, 0] }, settings: {}, remedy: {}, updating: 1, partsBefore: null, amount: { whole: { by: [2, 0, 0] }, fraction: 0.5 },
    before: { translate: {} }, parts: { wall: "handle", inlet: "fixed" },
  };
  const NOTHING: KeptOfRun = { pins: [], history: null, isWorstOwn: false, camera: null, isParallel: false, isSkeletonShown: false, isCompared: false, chosenView: null, draft: null, dismissed: [] };
  beforeEach(() => { stored = new Map(); });

  it("is its pins, what its monitors have said and whose the worst cells are, how the page stood, what stood in its form and what was dismissed, by its path", () => {
    const whole: KeptOfRun = {
      pins: [PIN], history: '"'.repeat(LONGEST_HISTORY - 1), isWorstOwn: true, camera: CAMERA, isParallel: true, isSkeletonShown: true, isCompared: true, chosenView: "cut", draft: DRAFT, dismissed: ["o1", "o2"],
    };
    new KeptRun(storage, "/a/").keep(whole);
    expect(new KeptRun(storage, "/a/").read()).toEqual(whole);
    expect(new KeptRun(storage, "/b/").read()).toEqual(NOTHING);
    new KeptRun(storage, "/a/").forget();
    expect(stored.size).toBe(0);
  });

  it("is nothing where it is rubbish, or where there is no room", () => {
    const page = new KeptRun(storage, "/");
    page.keep({ ...NOTHING, pins: [PIN] });
    const [key] = stored.keys();
    for (const text of ["{", "[]", "3", '{"pins": {}, "history": 1, "isWorstOwn": 1, "camera": [], "isParallel": 1, "isSkeletonShown": "x", "isCompared": {}, "chosenView": 3, "draft": 4, "dismissed": "o1"}']) {
      stored.set(key!, text);
      expect(page.read()).toEqual(NOTHING);
    }
    const wrong = [null, 3, { ...PIN, point: [1, 2] }, { ...PIN, point: [1, 2, "3"] }, { ...PIN, view: 1 }, { ...PIN, name: "<b>" }];
    stored.set(key!, JSON.stringify({ pins: [...wrong, ...Array.from({ length: 20 }, () => PIN)] }));
    expect(page.read().pins).toEqual(Array.from({ length: 8 }, () => PIN));
    stored.set(key!, JSON.stringify({ dismissed: [3, null, "x".repeat(201), ...Array.from({ length: 201 }, (_, i) => `o${i}`)] }));
    expect(page.read().dismissed).toEqual(Array.from({ length: 200 }, (_, i) => `o${i + 1}`));
    for (const camera of [{}, { ...CAMERA, position: [1, 2] }, { ...CAMERA, position: [0, 0, 0] }, { ...CAMERA, viewAngle: 0 }, { ...CAMERA, middle: [1] }, { ...CAMERA, parallel: 1 }]) {
      stored.set(key!, JSON.stringify({ camera }));
      expect(page.read().camera, JSON.stringify(camera)).toBeNull();
    }
    const drafts = [{}, { ...DRAFT, body: 3 }, { ...DRAFT, parts: { wall: "x" } }, { ...DRAFT, updating: -1 }, { ...DRAFT, updating: 0.5 }, { ...DRAFT, amount: { whole: {}, fraction: 2 } }, { ...DRAFT, settings: [] }, { ...DRAFT, key: 1 }];
    for (const draft of drafts) {
      stored.set(key!, JSON.stringify({ draft }));
      expect(page.read().draft, JSON.stringify(draft)).toBeNull();
    }
    new KeptRun({ ...storage, setItem: () => { throw new Error("full"); } }, "/").keep(NOTHING);
    expect(stored.size).toBe(0);
  });
});
