// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { LARGEST } from "../../src/files/edits";
import { FilesPanel } from "../../src/panels/files";
import { page } from "../page";
import { openDocument } from "./document";

describe("files", () => {
  const STACK = [{ translate: { features: ["throat"], by: [0, 0, 0.01] } }];
  let made: ReturnType<typeof page>;
  const button = (text: string): HTMLButtonElement => [...document.querySelectorAll<HTMLButtonElement>("#files-body button")].find(({ textContent }) => textContent === text)!;
  const settled = () => new Promise((resolve) => setTimeout(resolve, 0));
  /** Somebody has chosen a file. */
  const choose = async (text: string, size = text.length): Promise<void> => {
    const input = document.querySelector<HTMLInputElement>('#files-body input[type="file"]')!;
    Object.defineProperty(input, "files", { configurable: true, value: [{ name: "a.json", size, text: () => Promise.resolve(text) }] });
    input.dispatchEvent(new Event("change"));
    await settled();
  };

  beforeEach(() => {
    openDocument();
    made = page();
    new FilesPanel(made.store, made.commands, { surface: () => Promise.reject(new Error("it is torn")), content: () => null });
  });

  it("say why the surface cannot be saved, and a view that holds nothing", async () => {
    button("Surface (STL)").click();
    await settled();
    expect(made.store.state.refusal).toBe("The surface cannot be saved: it is torn.");
    made.greet({ views: [{ name: "cut", kind: "slice" }] });
    made.store.dispatch({ type: "view chosen", view: "cut" });
    button("View (VTP)").click();
    expect(made.store.state.refusal).toBe("The chosen view holds nothing yet.");
  });

  it("are loaded as an order of the whole stack", async () => {
    await choose(JSON.stringify({ stack: STACK }));
    expect([made.orders(), made.store.state.refusal]).toEqual([[{ stack: STACK }], ""]);
  });

  it("are not loaded where they hold no edits, or more than an order may: that is said, and nothing is ordered", async () => {
    await choose("{");
    expect(made.store.state.refusal).toMatch(/^a\.json cannot be loaded: it is not JSON: .*\.$/);
    await choose('{"stack": 3}');
    expect(made.store.state.refusal).toMatch(/^a\.json cannot be loaded: it has no list of edits/);
    await choose(JSON.stringify({ stack: STACK }), LARGEST + 1);
    expect(made.store.state.refusal).toBe(`a.json has ${LARGEST + 1} bytes, more than the ${LARGEST} of an order.`);
    expect(made.sent).toEqual([]);
    await choose(JSON.stringify({ stack: STACK }), LARGEST);
    expect(made.orders()).toEqual([{ stack: STACK }]);
  });

  it("are off where there is nothing to save or nobody to order, and loading says why", () => {
    const off = (): string[] => [...document.querySelectorAll<HTMLButtonElement>("#files-body button:disabled")].map(({ textContent }) => textContent);
    const hint = button("Load edits").title;
    const of = { stack: STACK, views: [{ name: "cut", kind: "slice" as const }] };
    expect(off()).toEqual(["Save edits", "View (VTP)"]);
    made.greet(of);
    expect(off()).toEqual([]);
    made.greet({ ...of, surface: null, role: "watcher", may_drive: false });
    expect(off()).toEqual(["Load edits", "Surface (STL)", "Displacement (CSV)"]);
    expect([button("Load edits").title, hint]).toEqual(["This link is for watching only.", "Orders the edits of a file in place of those that there are"]);
    made.greet(of);
    expect([off(), button("Load edits").title]).toEqual([[], hint]);
  });
});
