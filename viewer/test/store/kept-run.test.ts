import { beforeEach, describe, expect, it } from "vitest";
import { KeptRun, LONGEST_HISTORY } from "../../src/store/kept";

describe("what is kept of a run over a reload", () => {
  let stored: Map<string, string>;
  const storage = {
    getItem: (key: string) => stored.get(key) ?? null,
    setItem: (key: string, text: string) => void stored.set(key, text),
    removeItem: (key: string) => void stored.delete(key),
  };
  const PIN = { name: "probe 2", view: "cut", point: [1, 0.5, 0] as [number, number, number] };
  beforeEach(() => { stored = new Map(); });

  it("is its pins, what its monitors have said and whose the worst cells are, by its path", () => {
    const history = '"'.repeat(LONGEST_HISTORY - 1);
    new KeptRun(storage, "/a/").keep({ pins: [PIN], history, isWorstOwn: true });
    const { pins, history: said, isWorstOwn } = new KeptRun(storage, "/a/").read();
    expect([pins, said === history, isWorstOwn]).toEqual([[PIN], true, true]);
    expect(new KeptRun(storage, "/b/").read()).toEqual({ pins: [], history: null, isWorstOwn: false });
    new KeptRun(storage, "/a/").forget();
    expect(stored.size).toBe(0);
  });

  it("is nothing where it is rubbish, or where there is no room", () => {
    const page = new KeptRun(storage, "/");
    page.keep({ pins: [PIN], history: null, isWorstOwn: false });
    const [key] = stored.keys();
    for (const text of ["{", "[]", "3", '{"pins": {}, "history": 1, "isWorstOwn": 1}']) {
      stored.set(key!, text);
      expect(page.read()).toEqual({ pins: [], history: null, isWorstOwn: false });
    }
    const wrong = [null, 3, { ...PIN, point: [1, 2] }, { ...PIN, point: [1, 2, "3"] }, { ...PIN, view: 1 }, { ...PIN, name: "<b>" }];
    stored.set(key!, JSON.stringify({ pins: [...wrong, ...Array.from({ length: 20 }, () => PIN)] }));
    expect(page.read().pins).toEqual(Array.from({ length: 8 }, () => PIN));
    new KeptRun({ ...storage, setItem: () => { throw new Error("full"); } }, "/").keep({ pins: [], history: null, isWorstOwn: false });
    expect(stored.size).toBe(0);
  });
});
