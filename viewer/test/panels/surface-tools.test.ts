// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchSurfaceTools } from "../../src/panels/surface-tools";
import type { SkeletonShower } from "../../src/panels/surface-tools";
import { HELLO, page } from "../page";
import { openDocument } from "./document";

describe("Skeleton and Faces", () => {
  let made: ReturnType<typeof page>;
  let shower: SkeletonShower;
  let heard: unknown[];
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  const isPressed = (): boolean => at("skeleton").getAttribute("aria-pressed") === "true";

  beforeEach(() => {
    openDocument();
    made = page();
    heard = [];
    shower = { showSkeleton: (shown) => heard.push(shown), noSkeleton: () => undefined };
    watchSurfaceTools(made.store, shower, (text) => heard.push(text));
  });

  it("are off where there is no surface, and say why", () => {
    const titles = [at("skeleton").title, at("faces").title];
    const shown = () => ["skeleton", "faces"].map((id) => [at(id).disabled, at(id).title]);
    expect(shown()).toEqual(titles.map((title) => [false, title]));
    const moment = { seconds: 0, cycle: 0, time: 0 };
    made.greet({ surface: null, recording: { first: moment, last: moment, lost_bytes: 0 } });
    const why = "This is a recording: the surface from which shapes are measured is not in it.";
    expect(shown()).toEqual([[true, why], [true, why]]);
    made.greet({ surface: null });
    expect(at("faces").title).toMatch(/^There is no surface to shape: /);
    made.greet({ surface: HELLO.surface ?? null });
    expect(shown()).toEqual(titles.map((title) => [false, title]));
  });

  it("go off with the surface", () => {
    at("skeleton").click();
    expect([isPressed(), heard]).toEqual([true, [true]]);
    let clicks = 0;
    at("faces").addEventListener("click", () => clicks++);
    at("faces").setAttribute("aria-pressed", "true");
    made.greet({ surface: null });
    expect([isPressed(), heard, clicks]).toEqual([false, [true, false], 1]);
  });

  it("say over the picture why there is no skeleton, and it is not pressed then", () => {
    at("skeleton").click();
    shower.noSkeleton("it is a sheet");
    expect([isPressed(), heard]).toEqual([false, [true, "there is no skeleton: it is a sheet"]]);
  });
});
