import { describe, expect, it } from "vitest";
import type { FieldInformation, ForecastAnswer, Json } from "../../src/connection/protocol";
import { own } from "../../src/own";
import { asksNothing, bodyOf, chosen, openBoundariesMoved, wishedOrder, wishedStack, withMove } from "../../src/store/draft";
import { asFormOrder, isRedoable, provenance, undoable, whyNotEditable } from "../../src/store/edits";
import { looksOf, readLooks } from "../../src/store/looks";
import type { Looks } from "../../src/store/looks";
import { appliedOrders } from "../../src/store/orders";
import { runState, slowLink, whyNotSteering } from "../../src/store/run";
import { Selection } from "../../src/store/selection";
import { NO_PREVIEW } from "../../src/store/state";
import { applyButton, forecastLine, openBoundaryWarning, percent, previewLine, remedies } from "../../src/store/verdict";
import { STATUS, defaults, feature, page } from "../page";

const pinch = (z: number): Json => ({ scale_direction: { features: ["throat"], fixed: [], factors: [1, 1, z], harmonic_order: 2 } });
const FEATURES = [feature("inlet", "inflow"), feature("outlet", "outflow"), feature("walls", "wall"), feature("throat")];

/** A page on which the throat is to be half as high. */
function composed(hello: Parameters<typeof page>[0] = {}) {
  const made = page(hello);
  made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
  made.store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.5] }, step: "typed" });
  return made;
}

describe("open boundaries", () => {
  it("are held at first, where the solver says which they are, and stay as somebody wants them", () => {
    const { store, greet } = page({ features: FEATURES });
    expect(chosen(store.state, "fixed")).toEqual(["inlet", "outlet"]);
    store.dispatch({ type: "part", feature: "outlet", part: null });
    greet({ stack: [pinch(0.9)] });
    expect(chosen(store.state, "fixed")).toEqual(["inlet"]);
    expect(chosen(page().store.state, "fixed")).toEqual([]);
  });

  it("are not moved by more than a hundredth without a word", () => {
    const { store } = composed({ features: FEATURES });
    const moved = (outlet: number): void => store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state: "shown", largest: 0.5, size: 2, moved: { throat: 0.5, walls: 0.5, outlet } } });
    moved(0.019);
    expect(openBoundaryWarning(store.state)).toBe("");
    expect(applyButton(store.state).label).toBe("Apply");
    moved(0.021);
    expect(openBoundariesMoved(store.state).map(({ name }) => name)).toEqual(["outlet"]);
    expect(openBoundaryWarning(store.state)).toBe("outlet (outflow) would move by 0.021, 1.1 % of the size.");
    expect(applyButton(store.state)).toEqual({ label: "Apply anyway", why: "", isAnyway: true });
  });

  it("are said to move as they did before, while what is composed is previewed again", () => {
    const { store } = composed({ features: FEATURES });
    store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state: "waiting", largest: 0.5, size: 2, moved: { outlet: 0.021 } } });
    expect([openBoundaryWarning(store.state), applyButton(store.state).label]).toEqual(["outlet (outflow) would move by 0.021, 1.1 % of the size.", "Apply anyway"]);
    store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state: "waiting", largest: 0.5, size: 2, moved: { outlet: 0 } } });
    expect([openBoundaryWarning(store.state), applyButton(store.state).label]).toEqual(["", "Apply"]);
  });

  it("that are not held do not move without a word where no preview says how far", () => {
    const { store } = composed({ features: FEATURES });
    const said = (state: "waiting" | "failed" | "none"): string[] => {
      store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state } });
      return [openBoundaryWarning(store.state), applyButton(store.state).label];
    };
    expect([said("waiting"), said("failed")]).toEqual([["", "Apply"], ["", "Apply"]]);
    store.dispatch({ type: "part", feature: "inlet", part: null });
    expect(said("waiting")).toEqual(["Whether inlet moves is not known yet.", "Apply anyway"]);
    expect(said("failed")).toEqual(["Whether inlet moves is not known.", "Apply anyway"]);
    store.dispatch({ type: "part", feature: "outlet", part: "handle" });
    expect(said("failed")[0]).toBe("Whether inlet or outlet moves is not known.");
    // There may be no skeleton, too, while nothing is asked for.
    store.dispatch({ type: "cleared" });
    expect(said("failed")).toEqual(["", "Apply"]);
  });
});

describe("the values of parameters", () => {
  it("are those that were told last, by name", () => {
    const { store } = page({ parameters: [{ name: "inflow", value: 10, minimum: 0, maximum: 20 }, { name: "heating", value: 1, minimum: 0, maximum: 2 }] });
    store.dispatch({ type: "parameters", values: { inflow: 12, unheard: 3 } });
    expect(store.state.hello?.parameters).toEqual([{ name: "inflow", value: 12, minimum: 0, maximum: 20 }, { name: "heating", value: 1, minimum: 0, maximum: 2 }]);
  });
});

describe("the form's state", () => {
  it("asks for nothing after Apply, so that a second one does nothing", () => {
    const { store, commands, orders } = composed();
    expect(commands.apply()).toBe("");
    expect(orders()).toEqual([{ edits: [{ scale_direction: { features: ["throat"], fixed: [], factors: [1, 1, 0.5], harmonic_order: 2, muted: false } }] }]);
    expect(asksNothing(store.state)).toBe(true);
    expect(commands.apply()).toMatch(/Nothing is asked for/);
    expect(applyButton(store.state).why).toMatch(/Nothing is asked for/);
    expect(orders()).toHaveLength(1);
    expect(chosen(store.state, "handle")).toEqual(["throat"]);
  });

  it("asks for nothing after Cancel", () => {
    const { store } = composed();
    store.dispatch({ type: "cleared" });
    expect(bodyOf(store.state.draft).factors).toEqual([1, 1, 1]);
    expect(wishedStack(store.state)).toBeNull();
  });

  it("adds a second node of the skeleton to the first", () => {
    const { store } = page();
    const drag = (at: Json, by: Json, step: string): void => store.dispatch({ type: "composed", key: "skeleton", values: { moves: withMove(bodyOf(store.state.draft).moves, at, by) }, step });
    drag([0, 0, 1], [0.1, 0, 0], "drag 1");
    drag([0, 0, 1], [0.2, 0, 0], "drag 1");
    drag([0, 0, 5], [0, 0.3, 0], "drag 2");
    expect((wishedStack(store.state)![0] as { skeleton: Json }).skeleton).toMatchObject({ moves: [{ at: [0, 0, 1], by: [0.2, 0, 0] }, { at: [0, 0, 5], by: [0, 0.3, 0] }] });
    store.dispatch({ type: "step back" });
    expect(bodyOf(store.state.draft).moves).toEqual([{ at: [0, 0, 1], by: [0.2, 0, 0] }]);
  });

  it("takes a part of the amounts, whatever the edit", () => {
    const { store } = composed();
    const take = (key: string, values: { [name: string]: Json }, fraction: number): { [name: string]: Json } => {
      store.dispatch({ type: "composed", key, values, step: key });
      store.dispatch({ type: "amount", fraction });
      return bodyOf(store.state.draft);
    };
    expect(take("scale_direction", { factors: [1, 1, 0.5] }, 0.47).factors).toEqual([1, 1, 0.765]);
    store.dispatch({ type: "amount", fraction: 1 });
    expect(bodyOf(store.state.draft).factors).toEqual([1, 1, 0.5]);
    expect(take("translate", { by: [0.2, 0, -1] }, 0.5).by).toEqual([0.1, 0, -0.5]);
    expect(take("rotate", { degrees: 20, axis: [0, 1, 0] }, 0.5)).toMatchObject({ degrees: 10, axis: [0, 1, 0] });
    expect(take("affine", { matrix: [[3, 0, 0], [0, 1, 0], [0, 2, 1]] }, 0.5).matrix).toEqual([[2, 0, 0], [0, 1, 0], [0, 1, 1]]);
    expect(take("skeleton", { moves: [{ at: [1, 1, 1], by: [0, 0, 4] }] }, 0.25).moves).toEqual([{ at: [1, 1, 1], by: [0, 0, 1] }]);
  });
});

describe("an order that was refused", () => {
  const nudge = (x: number): Json => ({ translate: { features: ["wall"], fixed: [], by: [x, 0, 0], harmonic_order: 2, muted: false } });

  it("is what the form composes, for the stack that there is now", () => {
    const now = [pinch(0.5), nudge(1), nudge(2)];
    expect(asFormOrder({ edits: [nudge(9)], schedule: { steps: 3 } }, now)).toEqual({ edit: nudge(9), updating: null, isBetween: false, settings: { schedule: { steps: 3 } } });
    expect(asFormOrder({ stack: [pinch(0.5), nudge(9), nudge(2)] }, now)).toEqual({ edit: nudge(9), updating: 1, isBetween: false, settings: {} });
    // Another edit has come behind meanwhile.
    expect(asFormOrder({ stack: [pinch(0.1)] }, now)).toEqual({ edit: pinch(0.1), updating: 0, isBetween: false, settings: {} });
    expect(asFormOrder({ stack: [...now, nudge(9)] }, now)).toEqual({ edit: nudge(9), updating: null, isBetween: false, settings: {} });
    // A new edit before others, also one that is there already: which of two equal ones is the new one makes no difference.
    for (const edit of [nudge(9), nudge(1)]) expect(asFormOrder({ stack: [pinch(0.5), edit, nudge(1), nudge(2)] }, now)).toEqual({ edit, updating: null, isBetween: true, settings: {} });
    expect(asFormOrder({ stack: [nudge(9), ...now] }, now)).toMatchObject({ edit: nudge(9), isBetween: true });
    expect(asFormOrder({ stack: [nudge(9)] }, [])).toMatchObject({ edit: nudge(9), isBetween: false });
    const others: Json[] = [
      { undo: 1 }, { edits: [nudge(3), nudge(4)] }, { edits: [] }, { stack: now }, { stack: [] }, { stack: [pinch(0.5), nudge(2)] }, { stack: [pinch(0.5), nudge(2), nudge(1)] },
      { stack: [pinch(0.1), nudge(9), nudge(2)] }, { stack: [nudge(9), nudge(1), nudge(2)] },
      { stack: [nudge(9), pinch(0.5), nudge(2), nudge(1)] }, { stack: [pinch(0.1), ...now.slice(1), nudge(9)] }, { stack: [...now, nudge(8), nudge(9)] },
      { stack: [nudge(2), pinch(0.5), nudge(1)] }, { displacement: { file: "a" } }, null, 3,
    ];
    // Which order it took the place of, and until when it might wait, was of its own time.
    const settings = { schedule: { steps: 3 }, deform: { method: "surface" }, guard: { otherwise: "clamp" } };
    expect(asFormOrder({ edits: [nudge(9)], ...settings, replaces: "o1", deadline: { cycle: 9 } }, now)?.settings).toEqual(settings);
    for (const order of others) expect(asFormOrder(order, now), JSON.stringify(order)).toBeNull();
    expect(asFormOrder(undefined, now)).toBeNull();
  });

  it("comes back with what it set, and what was to mend it is for it alone", () => {
    const { store, commands, sent } = composed();
    const guard = { min_scaled_jacobian: 0.03, otherwise: "untangle" };
    store.dispatch({ type: "form read", key: "scale_direction", body: { ...bodyOf(store.state.draft) }, settings: { schedule: { steps: 3 } }, problems: [], step: "input steps" });
    store.dispatch({ type: "remedy", settings: { guard } });
    commands.apply();
    const [{ id }] = store.state.orders as unknown as [{ id: string }];
    const asked = sent.at(-1)!.order;
    store.dispatch({ type: "order", status: { id, status: "rejected", fraction: 0.5 } });
    expect(asksNothing(store.state)).toBe(true);
    store.dispatch({ type: "order taken up", id, fraction: 1 });
    expect(wishedOrder(store.state)).toEqual(asked);
    expect(store.state.draft).toMatchObject({ settings: { schedule: { steps: 3 } }, remedy: { guard } });
    store.dispatch({ type: "step back" });
    expect([asksNothing(store.state), store.state.draft.remedy]).toEqual([true, {}]);
    store.dispatch({ type: "order taken up", id: "another", fraction: 1 });
    expect(asksNothing(store.state)).toBe(true);
  });
});

describe("the guard that is set in the form", () => {
  it("stays there where an order with another one comes back, or one with none", () => {
    const ofForm = { min_scaled_jacobian: 0.1, otherwise: "reject" };
    const mending = { min_scaled_jacobian: 0.03, otherwise: "untangle" };
    for (const remedy of [{ guard: mending }, {}]) {
      const { store, commands } = composed();
      const read = (settings: { [key: string]: Json }): void =>
        store.dispatch({ type: "form read", key: "scale_direction", body: { ...bodyOf(store.state.draft) }, settings, problems: [], step: "input guard" });
      store.dispatch({ type: "remedy", settings: remedy });
      commands.apply();
      const { id } = store.state.orders[0]!;
      store.dispatch({ type: "order", status: { id, status: "rejected" } });
      read({ schedule: defaults.schedule, guard: ofForm });
      store.dispatch({ type: "order taken up", id, fraction: 1 });
      expect(wishedOrder(store.state)?.guard).toEqual(remedy.guard ?? ofForm);
      commands.apply();
      expect([store.state.draft.settings.guard, store.state.draft.remedy]).toEqual([ofForm, {}]);
    }
  });
});

describe("an earlier edit", () => {
  const stack = [pinch(0.5), { translate: { features: ["wall"], fixed: ["inlet"], by: [1, 0, 0], harmonic_order: 2, name: "shift" } }];

  it("is loaded, changed, and ordered with the whole stack", () => {
    const { store, commands, orders } = page({ stack });
    store.dispatch({ type: "edit loaded", index: 1 });
    expect(chosen(store.state, "handle")).toEqual(["wall"]);
    expect(chosen(store.state, "fixed")).toEqual(["inlet"]);
    expect(applyButton(store.state)).toMatchObject({ label: "Update edit 2", why: "The edit is as it was." });
    expect(wishedStack(store.state)).toBeNull();
    store.dispatch({ type: "composed", key: "translate", values: { by: [2, 0, 0] }, step: "typed" });
    expect(applyButton(store.state).why).toBe("");
    commands.apply();
    expect(orders()).toEqual([{ stack: [stack[0], { translate: { features: ["wall"], fixed: ["inlet"], by: [2, 0, 0], harmonic_order: 2, muted: false, name: "shift" } }] }]);
    expect(store.state.draft.updating).toBeNull();
    expect(asksNothing(store.state)).toBe(true);
  });

  it("takes the place of what stood in the form as a step that can be taken back", () => {
    const { store, greet } = composed({ stack });
    const before = wishedOrder(store.state);
    const composing = (): unknown => [store.state.draft.updating, chosen(store.state, "handle"), wishedOrder(store.state)];
    store.dispatch({ type: "edit loaded", index: 1 });
    expect(composing()).toEqual([1, ["wall"], null]);
    store.dispatch({ type: "edit loaded", index: 0 });
    store.dispatch({ type: "step back" });
    expect(composing()).toEqual([1, ["wall"], null]);
    store.dispatch({ type: "step back" });
    expect(composing()).toEqual([null, ["throat"], before]);
    store.dispatch({ type: "step forward" });
    expect(composing()).toEqual([1, ["wall"], null]);
    // No step leads to an edit that is not there any more.
    store.dispatch({ type: "step forward" });
    greet({ stack: [stack[0]!] });
    store.dispatch({ type: "step back" });
    expect(composing()).toEqual([null, ["throat"], before]);
  });

  it("leaves what was chosen before it chosen, and what flows in and out held, once it is given or given up", () => {
    const { store, commands } = page({ stack, features: [...FEATURES, feature("wall")] });
    const chosenNow = (): unknown => [chosen(store.state, "handle"), chosen(store.state, "fixed")];
    store.dispatch({ type: "part", feature: "throat", part: "handle" });
    for (const end of [() => store.dispatch({ type: "cleared" }), () => commands.apply()]) {
      store.dispatch({ type: "edit loaded", index: 1 });
      store.dispatch({ type: "edit loaded", index: 0 });
      store.dispatch({ type: "part", feature: "walls", part: "handle" });
      store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.4] }, step: "typed" });
      expect(chosenNow()).toEqual([["walls", "throat"], []]);
      end();
      expect(chosenNow()).toEqual([["throat"], ["inlet", "outlet"]]);
    }
    // What is chosen for a new edit stays for the next.
    store.dispatch({ type: "part", feature: "walls", part: "handle" });
    store.dispatch({ type: "cleared" });
    expect(chosenNow()).toEqual([["walls", "throat"], ["inlet", "outlet"]]);
  });

  it("is changed in part from what it is, as far as that passes", () => {
    const { store } = page({ stack: [...stack, { skeleton: { at: [0, 0, 1], by: [1, 0, 0], fixed: [], skinning: "linear" } }] });
    store.dispatch({ type: "edit loaded", index: 0 });
    store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.1] }, step: "typed" });
    store.dispatch({ type: "amount", fraction: 0.25 });
    expect(bodyOf(store.state.draft).factors).toEqual([1, 1, 0.4]);
    store.dispatch({ type: "amount", fraction: 0 });
    expect(asksNothing(store.state)).toBe(true);
    store.dispatch({ type: "edit loaded", index: 2 });
    store.dispatch({ type: "composed", key: "skeleton", values: { moves: [{ at: [0, 0, 1], by: [3, 0, 0] }, { at: [0, 0, 9], by: [0, 4, 0] }] }, step: "drag 1" });
    store.dispatch({ type: "amount", fraction: 0.5 });
    expect(bodyOf(store.state.draft).moves).toEqual([{ at: [0, 0, 1], by: [2, 0, 0] }, { at: [0, 0, 9], by: [0, 2, 0] }]);
  });

  it("that was not changed yet is asked for in part", () => {
    const { store } = page({ stack });
    store.dispatch({ type: "edit loaded", index: 0 });
    store.dispatch({ type: "amount", fraction: 0.5 });
    expect(bodyOf(store.state.draft).factors).toEqual([1, 1, 0.75]);
    store.dispatch({ type: "amount", fraction: 0.2 });
    expect(bodyOf(store.state.draft).factors).toEqual([1, 1, 0.9]);
    store.dispatch({ type: "amount", fraction: 1 });
    expect(asksNothing(store.state)).toBe(true);
  });

  it("of a skeleton comes back from its short form", () => {
    const { store } = page({ stack: [{ skeleton: { at: [0, 0, 1], by: [1, 0, 0], fixed: [], skinning: "linear" } }] });
    store.dispatch({ type: "edit loaded", index: 0 });
    expect(bodyOf(store.state.draft).moves).toEqual([{ at: [0, 0, 1], by: [1, 0, 0] }]);
    expect(asksNothing(store.state)).toBe(true);
  });

  it("that another changes meanwhile is no longer what is in the form", () => {
    const { store, greet } = page({ stack });
    store.dispatch({ type: "edit loaded", index: 1 });
    greet({ stack: [stack[0]!] });
    expect(store.state.draft.updating).toBeNull();
    expect(wishedOrder(store.state)).toBeNull();
  });

  it("waits while another order is under way", () => {
    const { store } = page({ stack });
    store.dispatch({ type: "order", status: { id: "x", status: "computing", order: { edits: [pinch(0.9)] } } });
    expect(whyNotEditable(store.state)).toMatch(/under way/);
    store.dispatch({ type: "order", status: { id: "x", status: "applied" } });
    expect(whyNotEditable(store.state)).toBe("");
  });

  it("is known by the order that brought it", () => {
    const order = (id: string, asked: Json) => ({ id, status: "applied" as const, text: id, order: asked, sentAt: null });
    const orders = [order("a", { edits: [pinch(0.5)] }), order("b", { edits: [pinch(0.6)] }), order("c", { undo: 1 }), order("d", { edits: [pinch(0.7)] }), order("e", { stack: [pinch(0.7), pinch(0.4)] })];
    expect(provenance(orders, [pinch(0.7), pinch(0.4)]).map((known) => known?.id)).toEqual(["d", "e"]);
    expect(provenance(orders.slice(0, 2), [pinch(0.7)])).toEqual([null]);
  });
});

describe("orders that have changed the shape", () => {
  it("are the same list as long as there is no other in it", () => {
    const { store } = page();
    const tell = (id: string, status: "applying" | "applied", shape: number, cycle: number): void => store.dispatch({ type: "order", status: { id, status, shape, shapes: 2, cycle_applied: cycle, order: { edits: [pinch(0.5)] } } });
    tell("a", "applying", 1, 5);
    const list = appliedOrders(store.state);
    expect(list).toEqual([{ cycle: 5, label: "Throat: height × 0.5" }]);
    tell("a", "applied", 2, 5);
    store.dispatch({ type: "frame", view: "v", cycle: 6 });
    expect(appliedOrders(store.state)).toBe(list);
    tell("b", "applying", 1, 9);
    expect(appliedOrders(store.state).map(({ cycle }) => cycle)).toEqual([5, 9]);
  });
});

describe("how views look", () => {
  const VELOCITY = { name: "velocity", association: "vertex" as const, components: 3 };
  const PRESSURE = { name: "pressure", association: "vertex" as const, components: 1 };
  const CUT = { name: "cut", kind: "slice" }, SHELL = { name: "shell", kind: "surface" };

  it("is by a field as soon as the run says which it has", () => {
    const { store, greet } = page({ views: [SHELL, CUT] });
    expect([store.state.looks.cut!.field, store.state.chosenView]).toEqual([null, "shell"]);
    greet({ fields: [PRESSURE, VELOCITY] });
    expect([store.state.looks.cut!.field, store.state.looks.shell!.field, store.state.chosenView]).toEqual(["velocity", null, "cut"]);
    greet({ fields: [] });
    expect(store.state.looks.cut!.field).toBe("velocity");
    greet({ fields: [PRESSURE] });
    expect(store.state.looks.cut!.field).toBe("pressure");
  });

  it("is by no field where somebody wants none, also after a reload", () => {
    const { store, greet } = page({ views: [CUT] });
    store.dispatch({ type: "look", view: "cut", look: { field: null } });
    greet({ fields: [VELOCITY] });
    expect(store.state.looks.cut!.field).toBeNull();
    expect(looksOf([CUT], [VELOCITY], readLooks(JSON.parse(JSON.stringify(store.state.looks)))).cut!.field).toBeNull();
  });

  it("is by a field that the view carries, where nobody has chosen one", () => {
    const { store, greet } = page({ views: [CUT], fields: [PRESSURE, VELOCITY] });
    const carries = (...fields: FieldInformation[]): string | null => {
      store.dispatch({ type: "carries", view: "cut", fields });
      return store.state.looks.cut!.field;
    };
    expect(store.state.looks.cut!.field).toBe("velocity");
    expect(carries(PRESSURE)).toBe("pressure");
    const vorticity = { name: "vorticity", association: "vertex" as const, components: 3 };
    expect(carries(PRESSURE, vorticity)).toBe("pressure");
    expect(carries({ ...PRESSURE, name: "quality" }, vorticity)).toBe("vorticity");
    greet({});
    expect(store.state.looks.cut!.field).toBe("vorticity");
    store.dispatch({ type: "look", view: "cut", look: { field: "vorticity" } });
    expect(carries(VELOCITY)).toBe("vorticity");
  });

  it("is by the field whose range was chosen, whatever the view carries later", () => {
    const { store } = page({ views: [CUT], fields: [VELOCITY] });
    store.dispatch({ type: "look", view: "cut", look: { range: { ...store.state.looks.cut!.range, kind: "fixed" } } });
    store.dispatch({ type: "carries", view: "cut", fields: [PRESSURE] });
    expect(store.state.looks.cut!.field).toBe("velocity");
  });

  it("may be told by a frame before the run has said which views there are", () => {
    const { store, greet } = page();
    store.dispatch({ type: "carries", view: "cut", fields: [PRESSURE] });
    greet({ views: [CUT], fields: [VELOCITY, PRESSURE] });
    expect(store.state.looks.cut!.field).toBe("pressure");
  });

  it("comes back with a view that was gone", () => {
    const A = { name: "a", kind: "slice" }, B = { name: "b", kind: "slice" };
    const { store, greet } = page({ views: [A] });
    store.dispatch({ type: "look", view: "a", look: { map: "cividis" } });
    store.dispatch({ type: "view chosen", view: "a" });
    const before = store.state.looks.a;
    greet({ views: [] });
    expect(store.state.chosenView).toBeNull();
    greet({ views: [B] });
    expect(store.state.chosenView).toBe("b");
    // What is done to all views is done to those that are there.
    store.dispatch({ type: "look", view: null, look: { opacity: 0.5 } });
    greet({ views: [A, B] });
    expect([store.state.looks.a, store.state.looks.b!.opacity]).toEqual([before, 0.5]);
  });

  it("is kept of so many views that are no more, the oldest out", () => {
    let looks: Looks = {};
    for (let i = 0; i < 300; i++) looks = looksOf([{ name: `view ${i}`, kind: "slice" }], [], looks);
    expect(Object.keys(looks)).toEqual(Array.from({ length: 201 }, (_, i) => `view ${i + 99}`));
  });

  it("leaves the field open over a reload where only something else was chosen", () => {
    const { store } = page({ views: [CUT] });
    store.dispatch({ type: "look", view: "cut", look: { opacity: 0.5 } });
    expect(looksOf([CUT], [VELOCITY], readLooks(JSON.parse(JSON.stringify(store.state.looks)))).cut).toMatchObject({ field: "velocity", opacity: 0.5 });
  });
});

describe("names that every object inherits", () => {
  const NAMES = ["constructor", "toString", "valueOf", "__proto__"];

  it("are views like others", () => {
    const { store, greet } = page();
    greet({ views: NAMES.map((name) => ({ name, kind: "slice" })), fields: [{ name: "p", association: "vertex", components: 1 }] });
    for (const name of NAMES) expect(own(store.state.looks, name), name).toMatchObject({ visible: true, field: "p" });
    for (const view of NAMES) store.dispatch({ type: "frame", view, cycle: 7 });
    expect(store.state.frames).toMatchObject({ count: 4, cycle: 7 });
    expect(store.state.chosenView).toBe("constructor");
  });

  it("are features like others", () => {
    const { store, greet } = page();
    greet({ features: NAMES.map((name) => feature(name, name === "valueOf" ? null : "inflow")) });
    expect(chosen(store.state, "fixed")).toEqual(NAMES.filter((name) => name !== "valueOf"));
    const selection = new Selection(store);
    expect(selection.get("valueOf")).toBeNull();
    selection.toggle("valueOf", "handle");
    expect(chosen(store.state, "handle")).toEqual(["valueOf"]);
  });
});

describe("taking back", () => {
  it("is offered only where there is something", () => {
    const { store } = page();
    expect(undoable(store.state)).toBe(0);
    expect(undoable(page({ stack: [pinch(0.5)] }).store.state)).toBe(1);
    expect(undoable(page({ stack: [], undoable: 2 }).store.state)).toBe(2);
  });

  it("of an undo brings the same stack back", () => {
    const { store, commands, greet, orders } = page({ stack: [pinch(0.5)] });
    expect(isRedoable(store.state)).toBe(false);
    const applied = (): void => store.dispatch({ type: "order", status: { id: store.state.orders.at(-1)!.id, status: "applied" } });
    commands.undo();
    applied();
    greet({ stack: [] });
    expect(isRedoable(store.state)).toBe(true);
    commands.redo();
    expect(orders()).toEqual([{ undo: 1 }, { stack: [pinch(0.5)] }]);
    applied();
    greet({ stack: [pinch(0.5)] });
    expect(isRedoable(store.state)).toBe(false);
    commands.redo();
    expect(orders()).toHaveLength(2);
  });

  it("waits for an order that is on its way, so that each is brought back by itself", () => {
    const { store, commands, orders } = page({ stack: [pinch(0.5), pinch(0.6)], undoable: 2 });
    const begun = (edits: Json[]): void => {
      store.dispatch({ type: "order", status: { id: store.state.orders.at(-1)!.id, status: "applying" } });
      store.dispatch({ type: "stack", edits, undoable: edits.length });
    };
    commands.undo();
    commands.undo();
    expect(orders()).toEqual([{ undo: 1 }]);
    begun([pinch(0.5)]);
    commands.undo();
    begun([]);
    commands.redo();
    expect(orders().at(-1)).toEqual({ stack: [pinch(0.5)] });
    begun([pinch(0.5)]);
    // Nor is an order taken back before it has changed the stack: nobody could bring it back.
    commands.order({ edits: [pinch(0.7)] });
    commands.undo();
    commands.redo();
    expect(orders().at(-1)).toEqual({ edits: [pinch(0.7)] });
    begun([pinch(0.5), pinch(0.7)]);
    commands.undo();
    begun([pinch(0.5)]);
    expect(isRedoable(store.state)).toBe(true);
  });

  it("waits for the edits of a stack that is another one, and of a connection that has come back", () => {
    const { store, commands, greet, sent } = page({ stack: [pinch(0.5)] });
    expect(whyNotEditable(store.state)).toBe("");
    store.dispatch({ type: "stack awaited", undoable: 2 });
    expect([whyNotEditable(store.state), undoable(store.state)]).toEqual(["The edits are being loaded.", 2]);
    commands.undo();
    store.dispatch({ type: "stack", edits: [pinch(0.5), pinch(0.6)], undoable: 2 });
    expect(whyNotEditable(store.state)).toBe("");
    store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    store.dispatch({ type: "connection", state: "connected", explanation: "" });
    expect(whyNotEditable(store.state)).toBe("The edits are being loaded.");
    commands.undo();
    greet({ stack: [pinch(0.5)], isAwaitingEdits: true });
    expect(whyNotEditable(store.state)).toBe("The edits are being loaded.");
    store.dispatch({ type: "edit loaded", index: 0 });
    store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.4] }, step: "typed" });
    expect(applyButton(store.state)).toMatchObject({ label: "Update edit 1", why: "The edits are being loaded." });
    expect(sent).toEqual([]);
  });

  it("does not go over what another has ordered meanwhile", () => {
    const { store, commands, greet } = page({ stack: [pinch(0.5)] });
    commands.undo();
    greet({ stack: [] });
    store.dispatch({ type: "order", status: { id: "other", status: "accepted", order: { edits: [pinch(0.8)] } } });
    expect(isRedoable(store.state)).toBe(false);
  });
});

describe("the verdict", () => {
  const refused = { outcome: "rejected" as const, reason: "cell 9856 would invert", fraction: 0.479, min_scaled_jacobian: -0.2, place: [1, 2, 3] as [number, number, number] };

  it("is a line each of preview and forecast, with the rest folded", () => {
    const { store } = composed();
    store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state: "shown", largest: 0.0123456, size: 0.3 } });
    expect(previewLine(store.state)).toEqual({ tone: "plain", text: "Preview: moves the surface by up to 0.0123 (4.1 % of its size)", details: "" });
    store.dispatch({ type: "status", status: { ...STATUS, quality: { min: 0.25 } }, at: 0 });
    store.dispatch({ type: "forecast told", answer: { outcome: "applied", shapes: 10, quality: { min: 0.2143, mean: 0.71, inverted: 0 }, seconds: { surface: 0.1, volume: 0.2, guard: 0.05 } } });
    expect(forecastLine(store.state)).toEqual({ tone: "good", text: "Forecast: least quality 0.214 (now 0.25), 0 inverted", details: "mean quality 0.71 · in 10 shapes · computed in 350\u00a0ms" });
    store.dispatch({ type: "forecast told", answer: { outcome: "clamped", fraction: 0.5, quality: { min: 0.02 } } });
    expect(forecastLine(store.state)).toMatchObject({ tone: "warning", text: "Forecast: 50 % of it is done, least quality 0.02 (now 0.25), 0 inverted" });
  });

  it("of a refusal turns Apply off and offers ways out", () => {
    const { store } = composed();
    store.dispatch({ type: "forecast told", answer: refused });
    expect(applyButton(store.state).why).toBe("It would be refused.");
    expect(forecastLine(store.state)).toEqual({ tone: "bad", text: "Forecast: it would be refused: 47 % of it would pass", details: "cell 9856 would invert" });
    expect(remedies(store.state)).toEqual({ fraction: 0.479, untangle: true, worst: [1, 2, 3] });
    store.dispatch({ type: "remedy", settings: { guard: { otherwise: "untangle" } } });
    expect(wishedOrder(store.state)!.guard).toEqual({ otherwise: "untangle" });
    expect(store.state.forecast.state).toBe("none");
    store.dispatch({ type: "forecast told", answer: refused });
    expect(remedies(store.state)!.untangle).toBe(false);
    store.dispatch({ type: "cleared" });
    expect(store.state.draft.remedy).toEqual({});
  });

  it("offers Untangle only where that can help", () => {
    const { store, greet } = composed();
    const isOffered = (answer: ForecastAnswer["order"]): boolean => {
      store.dispatch({ type: "forecast told", answer });
      return remedies(store.state)!.untangle;
    };
    const { min_scaled_jacobian: _, ...broken } = refused;
    const folds = (...brokenIn: string[]): void => store.dispatch({ type: "preview", preview: { ...NO_PREVIEW, state: "shown", faults: "2 pair(s) of faces intersect", brokenIn } });
    // The edit asks for what cannot be done at all.
    expect(isOffered({ outcome: "rejected", reason: "edits[0]: the axis has no length" })).toBe(false);
    // The surface breaks: what is left free of it may be led another way, what the edit places may not.
    expect(isOffered(broken)).toBe(true);
    folds("throat", "inlet");
    expect(isOffered(broken)).toBe(true);
    folds("throat");
    expect([isOffered(broken), isOffered(refused)]).toEqual([false, true]);
    // Without a volume nothing is mended, and what the run does by itself need not be asked for.
    greet({ defaults: { ...defaults, deform: { method: "surface" } } });
    expect(isOffered(refused)).toBe(false);
    greet({ defaults: { ...defaults, guard: { otherwise: "untangle" } } });
    expect(isOffered(refused)).toBe(false);
  });

  it("of one order says nothing of the next", () => {
    const { store } = composed();
    store.dispatch({ type: "forecast told", answer: refused });
    store.dispatch({ type: "amount", fraction: 0.479 });
    expect(store.state.forecast.state).toBe("none");
    store.dispatch({ type: "forecast told", answer: { outcome: "applied" } });
    store.dispatch({ type: "amount", fraction: 0.479 });
    store.dispatch({ type: "hover", feature: "wall" });
    expect(store.state.forecast.state).toBe("told");
  });

  it("never promises more than passes", () => {
    expect([0.479, 0.4799, 0.1, 0.0567, 0.999].map(percent)).toEqual(["47 %", "47 %", "10 %", "5.6 %", "99 %"]);
  });
});

describe("who steers, and how the run stands", () => {
  it("is said in words wherever a command would not be obeyed", () => {
    const { store, greet } = page();
    expect(whyNotSteering(store.state)).toBe("");
    greet({ role: "watcher" });
    store.dispatch({ type: "status", status: { ...STATUS, driver: "c9" }, at: 0 });
    expect(whyNotSteering(store.state)).toMatch(/Viewer c9 steers: ask/);
    greet({ role: "watcher", may_drive: false });
    expect(whyNotSteering(store.state)).toBe("This link is for watching only.");
    expect(applyButton(store.state).why).toBe("This link is for watching only.");
  });

  it("keeps a refusal only until the wheel is won", () => {
    const { store, greet } = page({ role: "watcher" });
    store.dispatch({ type: "refused", id: "1", text: "only the driver gives orders" });
    expect(store.state.refusal).toMatch(/driver/);
    greet({ role: "watcher" });
    expect(store.state.refusal).toMatch(/driver/);
    greet({ role: "driver" });
    expect(store.state.refusal).toBe("");
  });

  it("is unknown after a bare loss, and ended after a last word", () => {
    const { store } = page();
    expect(runState(store.state)).toBe("running");
    store.dispatch({ type: "connection", state: "reconnecting", explanation: "The connection was lost." });
    expect(runState(store.state)).toBe("unknown");
    expect(whyNotSteering(store.state)).toMatch(/no connection/);
    store.dispatch({ type: "end", end: { how: "finished", cycle: 420, time: 1 } });
    expect(runState(store.state)).toBe("ended");
    expect(whyNotSteering(store.state)).toBe("The run has ended.");
  });

  it("says that the picture is behind, and not why, only where it is", () => {
    const { store } = page();
    const at = (seconds: number, shown: number | null): string => {
      store.dispatch({ type: "status", status: { ...STATUS, cycle: 100 + 10 * seconds }, at: 1000 * seconds });
      if (shown !== null) store.dispatch({ type: "frame", view: "cut", cycle: shown });
      return slowLink(store.state, 1000 * seconds);
    };
    for (let second = 1; second < 10; second++) expect(at(second, 100 + 10 * second)).toBe("");
    // Frames come late, and every third of them alone.
    expect(at(11, 190)).toBe("");
    expect(at(14, 210)).toMatch(/^The picture is behind: 3 s old, 30 cycles; 1 of the last \d+ frames were left out\.$/);
    // Of a recording one may look at what was long ago.
    const moment = { seconds: 0, cycle: 0, time: 0 };
    store.dispatch({ type: "hello", hello: { ...store.state.hello!, recording: { first: moment, last: moment } } });
    expect(slowLink(store.state, 14_000)).toBe("");
    // One that comes seldom is not late.
    const seldom = page().store;
    seldom.dispatch({ type: "frame", view: "cut", cycle: 0 });
    seldom.dispatch({ type: "frame", view: "cut", cycle: 1000 });
    seldom.dispatch({ type: "status", status: { ...STATUS, cycle: 1000 }, at: 0 });
    seldom.dispatch({ type: "status", status: { ...STATUS, cycle: 1900 }, at: 90_000 });
    expect(slowLink(seldom.state, 90_000)).toBe("");
  });

  it("tells an order that never arrived from one that did", () => {
    const { store, commands, greet } = composed();
    commands.apply();
    const { id } = store.state.orders[0]!;
    store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    store.dispatch({ type: "connection", state: "connected", explanation: "" });
    greet({ orders: [] });
    expect(store.state.orders[0]).toMatchObject({ id, status: "lost" });
  });
});
