import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { orderForm } from "../../src/form/schema";
import { asksNothing, bodyOf, wishedOrder } from "../../src/store/draft";
import { draftToKeep, readDraft } from "../../src/store/kept-draft";
import type { KeptDraft, KeptForm } from "../../src/store/kept-draft";
import { reduce } from "../../src/store/reduce";
import { INITIAL } from "../../src/store/state";
import type { State } from "../../src/store/state";
import { HELLO, defaults, feature, page, schema } from "../page";

const STACK: Json[] = [{ translate: { features: ["wall"], fixed: ["inlet"], by: [1, 0, 0], harmonic_order: 2, muted: false } }];
const SCHEMA = { type: "schema", form: orderForm(schema), settings: { schedule: defaults.schedule } } as const;

/** What a page keeps on which the throat is to be half as high. */
function kept(): { draft: KeptDraft; order: Json } {
  const { store } = page();
  store.dispatch({ type: "part", feature: "throat", part: "handle" });
  store.dispatch({ type: "part", feature: "inlet", part: "fixed" });
  store.dispatch({ type: "composed", key: "scale_direction", values: { factors: [1, 1, 0.2] }, step: "typed" });
  store.dispatch({ type: "amount", fraction: 0.5 });
  return { draft: readDraft(JSON.parse(JSON.stringify(draftToKeep(store.state)))) as KeptDraft, order: wishedOrder(store.state)! };
}

/** A page that has been loaded again: its first message comes with no edits, which are fetched. */
function again(draft: KeptForm, hello: Partial<typeof HELLO> = {}): State {
  const connected = reduce(INITIAL, { type: "connection", state: "connected", explanation: "" });
  const greeted = reduce(connected, { type: "hello", hello: { ...HELLO, views: [{ name: "surface", kind: "surface" }, { name: "cut", kind: "slice" }], isAwaitingEdits: true, ...hello } });
  return reduce(greeted, { type: "remembered", chosenView: "cut", draft, dismissed: [] });
}

describe("what stands in the form", () => {
  it("is there again after a reload, once the form and the edits are, with its handle and the view that was chosen", () => {
    const { draft, order } = kept();
    let state = again(draft);
    expect(state.chosenView).toBe("cut");
    state = reduce(state, SCHEMA);
    // Loaded again once more before all had come: it is still to be kept.
    expect(draftToKeep(state)).toBe(draft);
    state = reduce(state, { type: "stack", edits: STACK, undoable: 1 });
    expect(wishedOrder(state)).toEqual(order);
    expect([state.keptDraft, state.draft.amount, state.refusal]).toEqual([null, { whole: expect.objectContaining({ factors: [1, 1, 0.2] }), fraction: 0.5 }, ""]);
    expect(state.selection.parts).toEqual({ throat: "handle", inlet: "fixed" });
    // Ctrl+Z takes it back before it takes back an order.
    state = reduce(state, { type: "step back" });
    expect(asksNothing(state)).toBe(true);
  });

  it("is the change of an earlier edit, where that is as it was", () => {
    const { store } = page({ stack: STACK });
    store.dispatch({ type: "part", feature: "throat", part: "handle" });
    store.dispatch({ type: "edit loaded", index: 0 });
    store.dispatch({ type: "composed", key: "translate", values: { by: [2, 0, 0] }, step: "typed" });
    const draft = draftToKeep(store.state)!;
    const order = wishedOrder(store.state)!;
    const same = reduce(reduce(again(draft), { type: "stack", edits: STACK, undoable: 1 }), SCHEMA);
    expect(wishedOrder(same)).toEqual(order);
    expect(same.draft.updating).toBe(0);
    // What was chosen before it is chosen again after it.
    expect([same.selection.parts, reduce(same, { type: "cleared" }).selection.parts]).toEqual([{ wall: "handle", inlet: "fixed" }, { throat: "handle" }]);
    const other = reduce(reduce(again(draft), { type: "stack", edits: [], undoable: 0 }), SCHEMA);
    expect([asksNothing(other), other.draft.updating, other.refusal]).toEqual([true, null, "What stood in the form before the page was loaded again is gone: the edit that it changes is another one now."]);
  });

  it("is dropped in words where the run does not know what it is of, and silently where it says nothing", () => {
    const { draft } = kept();
    const finished = (state: State): State => reduce(reduce(state, SCHEMA), { type: "stack", edits: [], undoable: 0 });
    const without = { features: ["inlet", "wall"].map((name) => feature(name)) };
    const dropped = finished(again(draft, without));
    expect([asksNothing(dropped), dropped.refusal]).toEqual([true, "What stood in the form before the page was loaded again is gone: the mesh has no feature throat any more."]);
    const unknown = finished(again({ ...draft, key: "knead" }));
    expect([unknown.refusal, unknown.selection.parts, unknown.keptDraft]).toEqual(["", {}, null]);
    const { store } = page();
    store.dispatch({ type: "part", feature: "throat", part: "handle" });
    const silent = draftToKeep(store.state)!;
    const left = finished(again(silent, without));
    expect([left.refusal, left.selection.parts]).toEqual(["", {}]);
    const there = finished(again(silent));
    expect([there.selection.parts, there.draft.past, asksNothing(there)]).toEqual([{ throat: "handle" }, [], true]);
  });

  it("is that which was composed meanwhile, where something was", () => {
    let state = reduce(again(kept().draft), SCHEMA);
    state = reduce(state, { type: "part", feature: "wall", part: "handle" });
    state = reduce(state, { type: "composed", key: "translate", values: { by: [7, 0, 0] }, step: "drag" });
    expect(draftToKeep(state)).toMatchObject({ body: { by: [7, 0, 0] } });
    state = reduce(state, { type: "stack", edits: [], undoable: 0 });
    expect([bodyOf(state.draft).by, state.keptDraft, state.selection.parts]).toEqual([[7, 0, 0], null, { wall: "handle" }]);
  });

  it("is gone in words where it is as long as a region of a whole mesh", () => {
    const { store } = page();
    store.dispatch({ type: "composed", key: "translate", values: { by: [1, 0, 0], region: { faces: Array.from({ length: 60_000 }, (_, i) => i) } }, step: "drag" });
    const mark = readDraft(JSON.parse(JSON.stringify(draftToKeep(store.state))))!;
    let state = reduce(again(mark), SCHEMA);
    // Nobody has been told yet.
    expect(draftToKeep(state)).toBe(mark);
    state = reduce(state, { type: "stack", edits: [], undoable: 0 });
    expect([state.keptDraft, state.refusal, asksNothing(state)]).toEqual([null, "What stood in the form before the page was loaded again is gone: it was too long to be kept.", true]);
    store.dispatch({ type: "composed", key: "translate", values: { by: [0, 0, 0] }, step: "drag" });
    expect(draftToKeep(store.state)).toBeNull();
  });
});
