// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { ForecastAnswer, Vector } from "../../src/connection/protocol";
import { VerdictPanel } from "../../src/panels/verdict";
import { bodyOf, wishedOrder } from "../../src/store/draft";
import { page } from "../page";
import { openDocument } from "./document";

const REFUSED: ForecastAnswer["order"] = { outcome: "rejected", reason: "cell 9856 at (1, 2, 3) would invert", fraction: 0.479, min_scaled_jacobian: -0.2, place: [1, 2, 3] };

describe("the foot of the form", () => {
  let made: ReturnType<typeof page>;
  let flights: Vector[];
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  beforeEach(() => {
    openDocument();
    made = page();
    flights = [];
    new VerdictPanel(made.store, made.commands, (place) => flights.push(place), () => undefined);
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    made.store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.5] }, step: "typed" });
  });

  it("gives the order once, and is neutral then", () => {
    expect(at("apply").disabled).toBe(false);
    at("apply").click();
    at("apply").click();
    expect(made.orders()).toHaveLength(1);
    expect(at("apply").disabled).toBe(true);
    expect(at("apply").title).toMatch(/Nothing is asked for/);
    expect(at("cancel").hidden).toBe(true);
  });

  it("turns Apply off where it would be refused, and offers what helps", () => {
    made.store.dispatch({ type: "forecast told", answer: REFUSED });
    expect(at("apply").disabled).toBe(true);
    expect(at("forecast").textContent).toBe("Forecast: it would be refused: 47 % of it would pass");
    expect(at("verdict-reasons").textContent).toBe("cell 9856 at (1, 2, 3) would invert");
    expect([at("apply-part").textContent, at("apply-part").hidden, at("untangle").hidden]).toEqual(["Apply 47 %", false, false]);
    at("show-worst").click();
    expect(flights).toEqual([[1, 2, 3]]);
    at("untangle").click();
    expect(wishedOrder(made.store.state)!.guard).toMatchObject({ otherwise: "untangle", min_scaled_jacobian: 0.03 });
  });

  it("has a slider of the amount that stops at what passes, and comes back from nothing", () => {
    const slide = (percent: number): void => {
      at("amount").value = String(percent);
      at("amount").dispatchEvent(new Event("input"));
    };
    const z = (): unknown => (bodyOf(made.store.state.draft).factors as number[])[2];
    made.store.dispatch({ type: "forecast told", answer: REFUSED });
    expect(at("amount-text").textContent).toBe("100 % of 47 %");
    slide(80);
    expect([z(), at("amount").value]).toEqual([0.7605, "47"]);
    slide(0);
    expect([z(), at("amount-row").hidden, at("apply").disabled]).toEqual([1, false, true]);
    slide(20);
    expect(z()).toBe(0.9);
  });

  it("has a slider that goes all the way again once what was refused is another order, or starts from another shape", () => {
    const { store } = made;
    const refused = (fraction: number): string => {
      store.dispatch({ type: "forecast told", answer: { ...REFUSED, fraction } });
      return at("amount-text").textContent;
    };
    const settings = { ...store.state.draft.settings, guard: { min_scaled_jacobian: 0.01 } };
    const changes: [string, () => void][] = [
      ["the handle", () => store.dispatch({ type: "part", feature: "wall", part: "handle" })],
      ["what is held", () => store.dispatch({ type: "part", feature: "inlet", part: "fixed" })],
      ["the guard", () => store.dispatch({ type: "form read", key: "scale_direction", body: { ...bodyOf(store.state.draft) }, settings, problems: [], step: "input guard" })],
      ["Untangle", () => at("untangle").click()],
      ["the stack", () => store.dispatch({ type: "stack", edits: [{ translate: { features: ["wall"], by: [1, 0, 0] } }], undoable: 1 })],
    ];
    for (const [what, change] of changes) {
      expect(refused(0.479), what).toBe("100 % of 47 %");
      change();
      expect(at("amount-text").textContent, what).toBe("100 %");
    }
    refused(0);
    store.dispatch({ type: "part", feature: "outlet", part: "fixed" });
    at("amount").value = "60";
    at("amount").dispatchEvent(new Event("input"));
    expect(at("amount-text").textContent).toBe("60 %");
    // What is only read again, or told again, is the same.
    refused(0.5);
    made.greet({ stack: structuredClone(store.state.hello!.stack) });
    expect(at("amount-text").textContent).toBe("60 % of 30 %");
  });

  it("does not look through the faces of a region at what is nothing to it", () => {
    let looked = 0;
    const faces = Object.assign([1, 2, 3], { toJSON: () => { looked++; return [1, 2, 3]; } });
    made.store.dispatch({ type: "composed", key: "translate", values: { region: { faces }, by: [0, 0, 1] }, step: "drag 1" });
    expect(at("amount-row").hidden).toBe(false);
    const before = looked;
    for (let cycle = 0; cycle < 5; cycle++) made.store.dispatch({ type: "frame", view: "v", cycle });
    expect(looked - before).toBe(0);
    made.store.dispatch({ type: "amount", fraction: 0.5 });
    expect([bodyOf(made.store.state.draft).by, at("amount-text").textContent, at("amount-row").hidden]).toEqual([[0, 0, 0.5], "50 %", false]);
  });

  it("takes Cancel for asking for nothing", () => {
    at("cancel").click();
    expect(wishedOrder(made.store.state)).toBeNull();
    expect(made.sent).toEqual([]);
  });

  it("says what is missing when it is pressed, and no longer once it is there", () => {
    made.store.dispatch({ type: "part", feature: "throat", part: null });
    at("apply").click();
    expect(at("problem").textContent).toMatch(/at least one feature/);
    made.store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.6] }, step: "typed" });
    expect(at("problem").hidden).toBe(true);
  });
});
