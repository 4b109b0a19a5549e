// @vitest-environment jsdom
import { afterEach, describe, expect, it, vi } from "vitest";
import { keepIdentity, knownIdentity } from "../../src/connection/identity";
import { writeForRun } from "../../src/store/session";

/** A storage that has room for so many characters. */
function storageOf(room: number) {
  const stored = new Map<string, string>();
  const storage = {
    getItem: (key: string) => stored.get(key) ?? null,
    setItem: (key: string, text: string) => {
      const others = [...stored].filter(([other]) => other !== key).reduce((sum, [other, value]) => sum + other.length + value.length, 0);
      if (others + key.length + text.length > room) throw new Error("full");
      stored.set(key, text);
    },
    removeItem: (key: string) => void stored.delete(key),
    key: (index: number) => [...stored.keys()][index] ?? null,
    get length() { return stored.size; },
  };
  return { stored, storage };
}

describe("the storage of the session", () => {
  afterEach(() => vi.unstubAllGlobals());

  it("makes room where it is full, of what is kept of other runs alone", () => {
    const { stored, storage } = storageOf(150);
    const before = { "tombolo-run /a/": "a".repeat(30), "tombolo-run /b/": "b".repeat(30), "tombolo-drafts /a/": "text" };
    for (const [key, text] of Object.entries(before)) storage.setItem(key, text);
    expect(writeForRun(storage, "/b/", { "tombolo-drafts /b/": "x" })).toBe(true);
    expect(stored.size).toBe(4);
    expect(writeForRun(storage, "/b/", { "tombolo-drafts /b/": "x".repeat(30) })).toBe(true);
    expect([...stored.keys()]).toEqual(["tombolo-run /b/", "tombolo-drafts /a/", "tombolo-drafts /b/"]);
  });

  it("has the name of this viewer also after many runs, and stops nothing where it takes none", () => {
    const { stored, storage } = storageOf(120);
    storage.setItem("tombolo-run /another/", "a".repeat(90));
    vi.stubGlobal("sessionStorage", storage);
    keepIdentity({ client: "c1", back: "b" });
    expect([knownIdentity(), stored.size]).toEqual([{ client: "c1", back: "b" }, 2]);
    keepIdentity({ client: "c1", back: "b".repeat(200) });
    expect([knownIdentity(), stored.size]).toEqual([null, 0]);
  });
});
