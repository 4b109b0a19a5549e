// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { Json, OrderStatus } from "../../src/connection/protocol";
import { EditsPanel } from "../../src/panels/edits";
import { bodyOf } from "../../src/store/draft";
import { move, remove, rename, toggleMute } from "../../src/store/edits";
import { page } from "../page";
import { openDocument } from "./document";

const shift = (x: number, more: { [key: string]: Json } = {}): Json => ({ translate: { features: ["wall"], by: [x, 0, 0], ...more } });

describe("the list of edits", () => {
  let made: ReturnType<typeof page>;
  const stack = [shift(1), shift(2, { muted: true }), shift(3, { name: "nudge" })];
  beforeEach(() => {
    openDocument();
    made = page({ stack });
    new EditsPanel(made.store, made.commands);
  });
  const button = (row: number, act: string): HTMLElement => document.querySelector<HTMLElement>(`#stack [data-edit="${row}"] [data-act="${act}"]`)!;
  const rows = (): string[] => [...document.querySelectorAll("#stack .title")].map((title) => title.textContent);

  it("says what each does, in words, or its name", () => {
    expect(rows()).toEqual(["Wall: moved by 1 along x", "Wall: moved by 2 along x", "nudge"]);
    expect(document.querySelector<HTMLElement>('#stack [data-edit="1"]')!.dataset.muted).toBe("true");
    expect(button(0, "remove").getAttribute("aria-label")).toBe("Delete: Wall: moved by 1 along x");
  });

  it("changes them by ordering the whole stack", () => {
    button(0, "mute").click();
    button(1, "mute").click();
    button(1, "remove").click();
    button(2, "load").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp", altKey: true }));
    expect(made.orders()).toEqual([{ stack: [shift(1, { muted: true }), stack[1], stack[2]] }]);
    // The others wait until what was sent has come: they would be made of an old stack.
    expect(button(1, "mute").getAttribute("aria-disabled")).toBe("true");
    made.store.dispatch({ type: "order", status: { id: made.store.state.orders[0]!.id, status: "applied" } });
    button(2, "load").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp", altKey: true }));
    expect(made.orders().at(-1)).toEqual({ stack: [stack[0], stack[2], stack[1]] });
  });

  it("loads an edit into the form with a click", () => {
    button(2, "load").click();
    expect(made.store.state.draft).toMatchObject({ updating: 2, key: "translate" });
    expect(button(2, "load").getAttribute("aria-pressed")).toBe("true");
  });

  it("keeps the focus where it was, over every change of the list", () => {
    button(1, "mute").focus();
    button(1, "mute").click();
    made.store.dispatch({ type: "order", status: { id: made.store.state.orders[0]!.id, status: "applied" } });
    made.greet({ stack: [stack[0]!, shift(2), stack[2]!] });
    expect(document.activeElement).toBe(button(1, "mute"));
    expect(button(1, "mute").getAttribute("aria-label")).toMatch(/^Mute/);
    button(2, "remove").focus();
    made.greet({ stack: [stack[0]!, shift(2)] });
    expect(document.activeElement).toBe(button(1, "remove"));
  });

  it("keeps a press on a row, and on the way to take an order back, while orders go on", () => {
    const order = (more: Partial<OrderStatus> & Pick<OrderStatus, "status">): void => made.store.dispatch({ type: "order", status: { id: "o1", order: { edits: [shift(3)] }, ...more } });
    /** A press over a change: as in a browser, what is clicked is what was pressed, if it has stayed. */
    const press = (find: () => HTMLElement, change: () => void): void => {
      const pressed = find();
      const removed: Node[] = [];
      const observer = new MutationObserver(() => undefined);
      observer.observe(document.body, { childList: true, subtree: true });
      pressed.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true }));
      change();
      for (const record of observer.takeRecords()) removed.push(...record.removedNodes);
      observer.disconnect();
      expect(find()).toBe(pressed);
      // One that was taken away and put back is clicked no more either.
      expect(removed.filter((node) => node.contains(pressed))).toEqual([]);
      pressed.dispatchEvent(new PointerEvent("pointerup", { bubbles: true }));
      pressed.click();
    };
    const cancel = (): HTMLElement => document.querySelector<HTMLElement>("#pending .cancel")!;
    order({ status: "accepted" });
    press(cancel, () => order({ status: "computing" }));
    expect(made.sent.at(-1)).toMatchObject({ cancel: { order: "o1" } });
    order({ status: "applying", shape: 1, shapes: 10 });
    press(() => button(2, "load"), () => order({ status: "applying", shape: 2, shapes: 10 }));
    expect(made.store.state.draft.updating).toBe(2);
    expect([document.querySelector("#pending .detail")!.textContent, document.querySelector<HTMLElement>("#pending .bar div")!.style.width]).toEqual(["shape 2 of 10", "20%"]);
    press(() => button(1, "remove"), () => order({ status: "applied" }));
    expect(made.orders()).toEqual([{ stack: [stack[0], stack[2]] }]);
    // Only the row whose edit is another one is made anew.
    const before = [0, 1, 2].map((row) => button(row, "load"));
    made.greet({ stack: [stack[0]!, shift(5), stack[2]!] });
    expect([0, 1, 2].map((row) => button(row, "load") === before[row])).toEqual([true, false, true]);
  });

  describe("are put in another sequence", () => {
    const at = (kind: string, row: number | null, on: EventTarget = window, pointerId = 1): void => {
      document.elementFromPoint = () => (row === null ? null : document.querySelector(`#stack [data-edit="${row}"] .title`));
      on.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, button: 0, pointerId, pointerType: "touch" }));
    };
    const marked = (name: string): (string | undefined)[] => [...document.querySelectorAll<HTMLElement>(`#stack .${name}`)].map((row) => row.dataset.edit);
    const others = [stack[1]!, stack[2]!, stack[0]!];
    /** The order was carried out, and its stack has come. */
    const done = (edits: Json[]): void => {
      made.store.dispatch({ type: "order", status: { id: made.store.state.orders.at(-1)!.id, status: "applied" } });
      made.store.dispatch({ type: "stack", edits, undoable: 1 });
    };

    it("by a finger, a pen or a mouse on the grip, also where the rows are made anew on the way, and the focus goes along", () => {
      at("pointerdown", 0, button(0, "move"));
      at("pointermove", 1);
      expect([marked("dragged"), marked("over")]).toEqual([["0"], ["1"]]);
      made.store.dispatch({ type: "order", status: { id: "o1", status: "applying", shape: 1, shapes: 10, order: { edits: [shift(3)] } } });
      expect([marked("dragged"), marked("over")]).toEqual([["0"], ["1"]]);
      at("pointermove", 2, window, 2);
      at("pointerup", 2, window, 2);
      expect(made.orders()).toEqual([]);
      at("pointermove", 2);
      at("pointerup", 2);
      expect([marked("dragged"), marked("over")]).toEqual([[], []]);
      expect(made.orders()).toEqual([{ stack: others }]);
      done(others);
      expect(document.activeElement).toBe(button(2, "move"));
    });

    it("by nothing that ends elsewhere, is given up, or may not change them", () => {
      const drag = (end: () => void): void => {
        at("pointerdown", 0, button(0, "move"));
        at("pointermove", 2);
        end();
        at("pointerup", 2);
      };
      drag(() => at("pointermove", null));
      at("pointerup", null);
      drag(() => at("pointercancel", 2));
      drag(() => window.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" })));
      drag(() => made.store.dispatch({ type: "stack awaited", undoable: 4 }));
      drag(() => undefined);
      expect(made.orders()).toEqual([]);
    });

    it("by arrows on the grip, or with Alt on the row, and the focus goes along", () => {
      const press = (on: HTMLElement, more: KeyboardEventInit = {}): void => {
        on.focus();
        on.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowDown", ...more }));
      };
      press(button(0, "load"));
      expect(made.orders()).toEqual([]);
      press(button(0, "load"), { altKey: true });
      done([stack[1]!, stack[0]!, stack[2]!]);
      expect(document.activeElement).toBe(button(1, "load"));
      press(button(1, "move"));
      expect(made.orders().at(-1)).toEqual({ stack: others });
      done(others);
      expect(document.activeElement).toBe(button(2, "move"));
      // What another has changed leaves the focus where it is.
      made.store.dispatch({ type: "stack", edits: [...others, shift(4)], undoable: 1 });
      expect(document.activeElement).toBe(button(2, "move"));
    });
  });

  it("gives a name with Enter, and none with Escape", () => {
    const type = (text: string, key: string): void => {
      button(2, "rename").click();
      const input = document.querySelector<HTMLInputElement>("#stack input")!;
      expect(input.value).toBe("nudge");
      input.value = text;
      input.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    };
    type("other", "Escape");
    expect(made.orders()).toEqual([]);
    type("push", "Enter");
    expect(made.orders()).toEqual([{ stack: [stack[0], stack[1], shift(3, { name: "push" })] }]);
  });

  it("leaves a name that is being typed alone while orders go on", () => {
    const applying = (shape: number): void => made.store.dispatch({ type: "order", status: { id: "o1", status: "applying", shape, shapes: 10, order: { edits: [shift(3)] } } });
    applying(1);
    button(0, "rename").click();
    const input = document.querySelector<HTMLInputElement>("#stack input")!;
    expect(document.activeElement).toBe(input);
    input.value = "thr";
    applying(2);
    expect(document.querySelector("#pending .detail")!.textContent).toBe("shape 2 of 10");
    expect([document.querySelector("#stack input"), input.value, document.activeElement]).toEqual([input, "thr", input]);
    expect(made.orders()).toEqual([]);
    input.value = "throat";
    input.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    expect(made.orders()).toEqual([{ stack: [shift(1, { name: "throat" }), stack[1], stack[2]] }]);
    expect(document.querySelector("#stack input")).toBeNull();
  });

  it("gives no name to another edit than the one that was meant, nor while edits are on their way", () => {
    const typed = (change: () => void): void => {
      button(0, "rename").click();
      const input = document.querySelector<HTMLInputElement>("#stack input")!;
      input.value = "push";
      change();
      input.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    };
    typed(() => made.store.dispatch({ type: "stack", edits: [shift(7), stack[0]!], undoable: 2 }));
    expect(made.orders()).toEqual([]);
    expect(made.store.state.refusal).toBe("The edit was not renamed. The edits have changed meanwhile.");
    expect(rows()).toEqual(["Wall: moved by 7 along x", "Wall: moved by 1 along x"]);
    typed(() => made.store.dispatch({ type: "stack awaited", undoable: 3 }));
    expect(made.orders()).toEqual([]);
    expect(made.store.state.refusal).toBe("The edit was not renamed. The edits are being loaded.");
  });

  it("changes nothing, and takes nothing back, until all edits are here", () => {
    made.store.dispatch({ type: "stack awaited", undoable: 4 });
    expect([button(0, "mute").getAttribute("aria-disabled"), button(0, "mute").title]).toEqual(["true", "The edits are being loaded."]);
    const undo = document.querySelector<HTMLButtonElement>("#undo")!;
    expect([undo.disabled, undo.title]).toEqual([true, "The edits are being loaded."]);
    for (const act of ["mute", "remove"]) button(0, act).click();
    button(2, "load").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp", altKey: true }));
    expect(made.orders()).toEqual([]);
    made.store.dispatch({ type: "stack", edits: [...stack, shift(4)], undoable: 4 });
    button(0, "remove").click();
    expect(made.orders()).toEqual([{ stack: [stack[1], stack[2], shift(4)] }]);
  });

  it("shows what is on its way with a way to take it back, and what was refused until it is dismissed", () => {
    const order = (status: "computing" | "applying" | "rejected", more: object = {}): void => made.store.dispatch({ type: "order", status: { id: "o1", status, order: { edits: [shift(9)] }, ...more } });
    order("computing");
    document.querySelector<HTMLElement>("#pending .cancel")!.click();
    expect(made.sent.at(-1)).toMatchObject({ cancel: { order: "o1" } });
    order("applying", { shape: 4, shapes: 10 });
    expect(document.querySelector("#pending .cancel")).toBeNull();
    expect(document.querySelector("#pending .detail")!.textContent).toBe("shape 4 of 10");
    order("rejected", { reason: "cells invert" });
    expect(document.querySelector("#pending")!.textContent).toMatch(/Wall: moved by 9 along x.*refused.*cells invert/);
    document.querySelector<HTMLElement>("#pending .icon")!.click();
    expect(document.querySelector("#pending")!.textContent).toBe("");
    expect(document.querySelector("#orders")!.textContent).toMatch(/cells invert/);
  });

  it("shows no refusal again that was dismissed, also where a recording goes back to before it and on again", () => {
    const recording = { first: { seconds: 0, cycle: 0, time: 0 }, last: { seconds: 9, cycle: 900, time: 9 } };
    const rejected = (id: string): OrderStatus => ({ id, status: "rejected", order: { edits: [shift(9)] }, reason: "cells invert" });
    const shown = (): (string | undefined)[] => [...document.querySelectorAll<HTMLElement>("#pending [data-order]")].map((row) => row.dataset.order);
    made.greet({ recording, orders: [rejected("o1"), rejected("o2")] });
    document.querySelector<HTMLElement>('#pending [data-order="o1"] .icon')!.click();
    expect(shown()).toEqual(["o2"]);
    for (const orders of [[], [rejected("o1"), rejected("o2")]]) made.greet({ recording, orders });
    expect(shown()).toEqual(["o2"]);
  });

  it("keeps the focus on the buttons of an order, whatever becomes of it and whoever comes", () => {
    const told = (id: string, status: "computing" | "rejected"): void => made.store.dispatch({ type: "order", status: { id, status, order: { edits: [shift(9)] }, reason: "cells invert" } });
    const at = (id: string, act: string): HTMLElement => document.querySelector<HTMLElement>(`#pending [data-order="${id}"] [data-act="${act}"]`)!;
    told("o1", "rejected");
    told("o2", "computing");
    at("o2", "cancel").focus();
    made.store.dispatch({ type: "people", viewers: [] });
    expect(document.activeElement).toBe(at("o2", "cancel"));
    told("o2", "rejected");
    expect(document.activeElement).toBe(at("o2", "dismiss"));
    at("o1", "again").focus();
    made.store.dispatch({ type: "people", viewers: [{ client: "c2", name: "Anna", role: "watcher", may_drive: true }] });
    expect(document.activeElement).toBe(at("o1", "again"));
    at("o1", "dismiss").focus();
    at("o1", "dismiss").click();
    expect(document.activeElement).toBe(at("o2", "dismiss"));
    at("o2", "dismiss").click();
    expect(document.activeElement?.id).toBe("undo");
  });

  it("does not call what somebody took back refused, and says who did", () => {
    const rejected = (id: string, reason: string): void => made.store.dispatch({ type: "order", status: { id, status: "rejected", order: { edits: [shift(9)] }, reason } });
    const told = (id: string): (string | undefined)[] => {
      const row = document.querySelector<HTMLElement>(`#pending [data-order="${id}"]`)!;
      return [row.dataset.status, row.querySelector(".chip")!.textContent, row.querySelector(".detail")!.textContent];
    };
    rejected("o1", "cancelled by c1");
    expect(told("o1")).toEqual(["cancelled", "cancelled", "by you"]);
    expect(document.querySelector<HTMLElement>("#orders li")!.dataset.status).toBe("cancelled");
    rejected("o2", "cancelled by c2");
    expect(document.getElementById("announcer")!.textContent).toBe("Wall: moved by 9 along x: cancelled by viewer c2");
    made.store.dispatch({ type: "people", viewers: [{ client: "c2", name: "Anna", role: "watcher", may_drive: true }] });
    expect(told("o2")).toEqual(["cancelled", "cancelled", "by Anna (c2)"]);
    rejected("o3", "cancelled");
    rejected("o4", "replaced by order o5 by c1");
    rejected("o5", "cell 1 would invert; cancelled by c1");
    expect([told("o3"), told("o4"), told("o5")]).toEqual([
      ["cancelled", "cancelled", ""], ["replaced", "replaced", "by another order, given by you"], ["rejected", "refused", "cell 1 would invert; cancelled by c1"],
    ]);
  });

  it("brings a refused order back into the form, as it was or as much of it as would pass", () => {
    const orderOf = (id: string, order: Json, fraction: number | null): void => made.store.dispatch({ type: "order", status: { id, status: "rejected", order, reason: "cells invert", fraction } });
    const ways = (id: string): string[] => [...document.querySelectorAll(`#pending [data-order="${id}"] .ways button`)].map(({ textContent }) => textContent);
    const press = (id: string, act: string): void => document.querySelector<HTMLElement>(`#pending [data-order="${id}"] [data-act="${act}"]`)!.click();
    orderOf("o1", { edits: [shift(9, { fixed: ["inlet"] })] }, 0.4709);
    expect(ways("o1")).toEqual(["Apply 47 %", "Edit again"]);
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    press("o1", "again");
    const { state } = made.store;
    expect([bodyOf(state.draft).by, state.draft.updating, state.selection.parts]).toEqual([[9, 0, 0], null, { wall: "handle", inlet: "fixed" }]);
    expect(document.activeElement?.id).toBe("foot");
    made.store.dispatch({ type: "step back" });
    expect(made.store.state.selection.parts).toEqual({ throat: "handle" });
    press("o1", "part");
    expect(bodyOf(made.store.state.draft).by).toEqual([4.23, 0, 0]);
    expect(made.store.state.draft.amount).toMatchObject({ fraction: 0.47, whole: { by: [9, 0, 0] } });
    // One that a program gave, with what no form holds, and one that was no more than a part of the way back.
    orderOf("o2", { edits: [shift(1), shift(2)] }, 0.5);
    orderOf("o3", { undo: 1 }, null);
    expect([ways("o2"), ways("o3")]).toEqual([[], []]);
    // One of a program or a file, with one edit more between those that there are: the form adds it behind them, which is another order.
    orderOf("o5", { stack: [stack[0]!, shift(7), stack[1]!, stack[2]!] }, 0.5);
    expect(ways("o5")).toEqual(["Edit again"]);
    expect(document.querySelector<HTMLElement>('#pending [data-order="o5"] [data-act="again"]')!.title).toContain("comes behind the others");
    press("o5", "again");
    expect([made.store.state.draft.updating, bodyOf(made.store.state.draft).by]).toEqual([null, [7, 0, 0]]);
    document.querySelector<HTMLElement>('#pending [data-order="o5"] [data-act="dismiss"]')!.click();
    orderOf("o4", { stack: [stack[0]!, shift(8, { muted: true }), stack[2]!] }, null);
    expect(ways("o4")).toEqual(["Edit again"]);
    press("o4", "again");
    expect(made.store.state.draft).toMatchObject({ key: "translate", updating: 1 });
    made.commands.apply();
    expect((made.orders().at(-1) as { stack: Json[] }).stack).toMatchObject([stack[0]!, shift(8, { muted: true }), stack[2]!]);
  });

  it("lets nobody take back what is not there, and no watcher anything, with the reason", () => {
    const undo = document.querySelector<HTMLButtonElement>("#undo")!;
    expect(undo.disabled).toBe(false);
    made.greet({ stack: [] });
    expect([undo.disabled, undo.title]).toEqual([true, "There is nothing to take back."]);
    made.greet({ stack, role: "watcher" });
    expect(undo.disabled).toBe(true);
    expect(button(0, "mute").getAttribute("aria-disabled")).toBe("true");
    expect(button(0, "mute").title).toMatch(/ask to steer/);
    button(0, "mute").click();
    expect(made.sent).toEqual([]);
  });
});

describe("a stack", () => {
  it("survives edits that make no sense", () => {
    for (const odd of [null, 3, "x", [], {}, { translate: null }] as Json[]) {
      expect(toggleMute([odd], 0)).toEqual([odd]);
      expect(rename([odd], 0, "a")).toEqual([odd]);
      expect(move([odd, 1], 1, 0)).toEqual([1, odd]);
      expect(remove([odd, 1], 0)).toEqual([1]);
      openDocument();
      const made = page({ stack: [odd] });
      new EditsPanel(made.store, made.commands);
      document.querySelector<HTMLElement>('#stack [data-act="load"]')!.click();
    }
  });
});
