// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { PinnedNote, Vector } from "../../src/connection/protocol";
import { NotesPanel } from "../../src/panels/notes";
import { Marks } from "../../src/picture/marks";
import { page } from "../page";
import { openDocument } from "./document";

const note = (number: number, text: string, more: Partial<PinnedNote> = {}): PinnedNote => ({ number, text, at: [number, 0, 0], cycle: 40, by: "Anna", ...more });

describe("notes", () => {
  let made: ReturnType<typeof page>;
  let panel: NotesPanel;
  let flown: Vector[];
  const at = <T extends HTMLElement = HTMLButtonElement>(id: string): T => document.getElementById(id) as T;
  const last = (): { [key: string]: unknown } => made.sent.at(-1)!;
  const type = (text: string): void => {
    at<HTMLTextAreaElement>("note-text").value = text;
    at("note-text").dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true, cancelable: true }));
  };
  beforeEach(() => {
    openDocument();
    made = page();
    flown = [];
    const marks = new Marks(document.querySelector<SVGElement>("#marks")!, ([x, y]) => [x, y]);
    panel = new NotesPanel(made.store, made.commands, marks, { flyTo: (place) => flown.push(place), middle: () => [7, 8, 9] }, () => undefined);
  });

  it("pins where somebody clicks, or in the middle of the picture, at the cycle that is seen", () => {
    made.store.dispatch({ type: "frame", view: "a", cycle: 120 });
    at("note").click();
    panel.toggle();
    expect([panel.choosing, at("note").getAttribute("aria-pressed")]).toEqual([true, "true"]);
    panel.take([0.5, 0.25, -1]);
    expect([panel.choosing, document.activeElement, at("note-place").textContent]).toEqual([false, at("note-text"), "at (0.5, 0.25, −1)"]);
    type("the eddy");
    expect(last()).toMatchObject({ note: { text: "the eddy", at: [0.5, 0.25, -1], cycle: 120 } });
    expect([at<HTMLTextAreaElement>("note-text").value, at("note-place").textContent]).toEqual(["", "in the middle of the picture"]);
    type("another");
    expect(last()).toMatchObject({ note: { text: "another", at: [7, 8, 9] } });
    const count = made.sent.length;
    type("  ");
    expect([made.sent.length, at("note-problem").textContent]).toEqual([count, "A note needs a text."]);
  });

  it("of a recording lead to their place and their cycle, at which they are not told yet", () => {
    const recording = { first: { seconds: 0, cycle: 0, time: 0 }, last: { seconds: 9, cycle: 900, time: 9 } };
    const rows = (): string[] => [...at("notes").querySelectorAll(".title")].map(({ textContent }) => textContent);
    const press = (number: number): void => at("notes").querySelector<HTMLElement>(`[data-note="${number}"] .load`)!.click();
    made.greet({ notes: [note(1, "the eddy"), note(2, "the gap", { cycle: 80 })] });
    press(2);
    expect([flown, made.sent]).toEqual([[[2, 0, 0]], []]);
    made.greet({ recording, notes: [note(1, "the eddy"), note(2, "the gap", { cycle: 80 })] });
    press(2);
    expect([flown.length, last()]).toMatchObject([2, { play: { seek: { cycle: 80 } } }]);
    // The second click of a double click, and whatever else makes the recording say again where it is.
    press(2);
    for (const _ of [1, 2, 3]) {
      made.greet({ recording, notes: [note(1, "the eddy")] });
      expect(rows()).toEqual(["the eddy", "the gap"]);
    }
    // Once it is told there it needs nobody who looks for it.
    made.greet({ recording, notes: [note(1, "the eddy"), note(2, "the gap")] });
    made.greet({ recording, notes: [note(1, "the eddy")] });
    expect(rows()).toEqual(["the eddy"]);
    press(1);
    made.greet({ recording, notes: [note(1, "the eddy")] });
    expect(rows()).toEqual(["the eddy"]);
  });

  it("gives a text back that was refused", () => {
    type("too much");
    expect(panel.refused("another", "x")).toBe(false);
    expect(panel.refused(String(last().id), "found 201 notes, expected at most 200")).toBe(true);
    expect([at<HTMLTextAreaElement>("note-text").value, at("note-problem").textContent]).toEqual(["too much", "found 201 notes, expected at most 200"]);
  });

  it("lists notes as text, flies to them, marks them and takes them away", () => {
    made.greet({ notes: [note(1, "<b>here</b>"), note(2, "a note that is longer than what goes beside a pin")] });
    made.store.dispatch({ type: "note pinned", note: note(3, "third") });
    made.store.dispatch({ type: "note pinned", note: note(3, "third") });
    const rows = (): HTMLElement[] => [...document.querySelectorAll<HTMLElement>("#notes li")];
    expect(rows().map((row) => row.querySelector(".title")!.textContent)).toEqual(["<b>here</b>", "a note that is longer than what goes beside a pin", "third"]);
    expect(rows()[0]!.querySelector(".detail")!.textContent).toBe("Anna · cycle 40");
    expect([...document.querySelectorAll("#marks text")].map((text) => text.textContent)).toEqual(["<b>here</b>", "a note that is longer than …", "third"]);
    rows()[1]!.querySelector<HTMLElement>(".load")!.click();
    expect(flown).toEqual([[2, 0, 0]]);
    rows()[0]!.querySelector<HTMLElement>('[data-act="remove"]')!.click();
    expect(last()).toMatchObject({ remove_note: { number: 1 } });
    made.store.dispatch({ type: "note removed", number: 1 });
    expect(rows().length).toBe(2);
    // A later hello of the same connection says nothing of notes.
    made.greet({});
    expect(rows().length).toBe(2);
  });

  it("keep the focus where it is, whatever is pinned and removed", () => {
    const button = (number: number, selector: string): HTMLElement => document.querySelector<HTMLElement>(`#notes [data-note="${number}"] ${selector}`)!;
    made.greet({ notes: [1, 2, 3].map((number) => note(number, `note ${number}`)) });
    button(3, '[data-act="remove"]').focus();
    made.store.dispatch({ type: "note pinned", note: note(4, "fourth") });
    expect(document.activeElement).toBe(button(3, '[data-act="remove"]'));
    made.store.dispatch({ type: "note removed", number: 1 });
    expect(document.activeElement).toBe(button(3, '[data-act="remove"]'));
    button(2, ".load").focus();
    made.store.dispatch({ type: "note removed", number: 4 });
    expect(document.activeElement).toBe(button(2, ".load"));
    made.store.dispatch({ type: "note removed", number: 2 });
    expect(document.activeElement).toBe(button(3, ".load"));
    made.store.dispatch({ type: "note removed", number: 3 });
    expect(document.activeElement).toBe(at("note-text"));
  });

  it("lets a watcher read and fly, and write nothing", () => {
    made.greet({ role: "watcher", may_drive: false, notes: [] });
    expect(at("notes-panel").hidden).toBe(true);
    made.store.dispatch({ type: "note pinned", note: note(1, "here") });
    expect([at("notes-panel").hidden, at("note-form").hidden, at("note").disabled]).toEqual([false, true, true]);
    expect(document.querySelector('[data-act="remove"]')).toBeNull();
    panel.toggle();
    expect(panel.choosing).toBe(false);
    // One who could steer writes also while another does.
    made.greet({ role: "watcher", may_drive: true });
    expect(at("note-form").hidden).toBe(false);
  });
});
