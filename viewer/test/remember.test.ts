// @vitest-environment jsdom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { keepIdentity } from "../src/connection/identity";
import type { Hello } from "../src/connection/protocol";
import { Memory } from "../src/remember";
import type { Remembered } from "../src/remember";
import { KeptRun } from "../src/store/kept";
import { HELLO, page } from "./page";
import { openDocument } from "./panels/document";

const STAND: Remembered["camera"]["stand"] = { position: [0, 0, 3], focalPoint: [0, 0, 0], viewUp: [0, 1, 0], parallel: false, parallelScale: 1, viewAngle: 30 };
const MOVED: typeof STAND = { ...STAND, position: [1, 2, 3] };

describe("a page that is loaded again", () => {
  let listeners: unknown[];
  const left = (): boolean => window.dispatchEvent(new Event("pagehide"));
  /** A page of a run, its camera and its switches; `drawn` draws its first picture. */
  function opened(hello: Partial<Hello> = {}, isEmbedded = false) {
    openDocument();
    const made = page({ views: [{ name: "surface", kind: "surface" }, { name: "cut", kind: "slice" }], ...hello });
    const pressed: string[] = [];
    for (const id of ["skeleton", "compare"]) {
      document.getElementById(id)!.addEventListener("click", ({ currentTarget }) => {
        pressed.push(id);
        (currentTarget as HTMLElement).setAttribute("aria-pressed", "true");
      });
    }
    const camera = { stand: STAND, isWhole: true, parallel: false, isPlaced: true };
    let drawn = (): void => undefined;
    const restored = vi.fn();
    const memory = new Memory(made.store, new KeptRun(sessionStorage, "/"), {
      isEmbedded, camera, restored, compare: { restore: () => pressed.push("compare as it was") }, whenDrawn: (then) => { drawn = then; }, pins: { kept: [], restore: vi.fn() },
      worst: { kept: false, restore: vi.fn(), leave: vi.fn() }, monitored: { kept: () => null, restore: vi.fn() },
    });
    memory.greeted({ ...HELLO, ...hello });
    return { ...made, camera, pressed, restored, drawn: () => drawn() };
  }
  let added: { mock: { calls: unknown[][] }; mockRestore(): void };
  beforeEach(() => {
    sessionStorage.clear();
    listeners = [];
    added = vi.spyOn(window, "addEventListener");
    keepIdentity({ client: "c1", back: "b" });
  });
  const forgetListeners = (): void => {
    listeners = added.mock.calls.filter(([name]) => name === "pagehide").map(([, listener]) => listener);
    for (const listener of listeners) window.removeEventListener("pagehide", listener as EventListener);
  };
  afterEach(() => {
    forgetListeners();
    added.mockRestore();
  });
  /** Leaves a page, and opens it again. */
  const again = (hello: Partial<Hello> = {}, isEmbedded = false): ReturnType<typeof opened> => {
    left();
    forgetListeners();
    return opened(hello, isEmbedded);
  };

  it("is as it was: camera, projection, view and switches, also if it is left before its first picture", () => {
    const before = opened();
    Object.assign(before.camera, { stand: MOVED, isWhole: false, parallel: true });
    before.store.dispatch({ type: "view chosen", view: "surface" });
    for (const id of ["skeleton", "compare"]) document.getElementById(id)!.click();
    const early = again();
    expect([early.pressed, early.camera]).toEqual([[], { stand: MOVED, isWhole: true, parallel: true, isPlaced: true }]);
    early.camera.isWhole = false;
    const late = again();
    late.drawn();
    expect([late.pressed, late.camera.stand, late.store.state.chosenView]).toEqual([["skeleton", "compare as it was"], MOVED, "surface"]);
    expect(late.restored).toHaveBeenCalledOnce();
  });

  it("shares nothing with one that shows a view alone, in which another run's is forgotten all the same", () => {
    Object.assign(opened().camera, { stand: MOVED, isWhole: false });
    const alone = again({}, true);
    expect(alone.camera.stand).toBe(STAND);
    Object.assign(alone.camera, { stand: { ...MOVED, viewAngle: 50 }, isWhole: false });
    expect(again().camera.stand).toEqual(MOVED);
    again({ back: "another" }, true);
    expect(sessionStorage.getItem("tombolo-run /")).toBeNull();
  });

  it("shows the whole where that was shown, as large as there is room for now", () => {
    opened().camera.stand = MOVED;
    expect(again().camera.stand).toBe(STAND);
  });

  it("shows no refusal again that was dismissed, unless it is another run's", () => {
    const orders = ["o1", "o2"].map((id) => ({ id, status: "rejected" as const, reason: "cells invert" }));
    opened({ orders }).store.dispatch({ type: "order dismissed", id: "o1" });
    const shown = ({ store }: ReturnType<typeof opened>): string[] => store.state.orders.filter(({ id }) => !store.state.dismissed.includes(id)).map(({ id }) => id);
    expect(shown(again({ orders }))).toEqual(["o2"]);
    expect(shown(again({ orders }))).toEqual(["o2"]);
    expect(shown(again({ orders, back: "another" }))).toEqual(["o1", "o2"]);
  });

  it("is new where another run answers", () => {
    const before = opened();
    Object.assign(before.camera, { stand: MOVED, isWhole: false });
    expect(again({ back: "another" }).camera.stand).toBe(STAND);
    expect(sessionStorage.getItem("tombolo-run /")).toBeNull();
  });
});
