// @vitest-environment jsdom
import { expect, it } from "vitest";
import { ViewList } from "../../src/panels/views";
import { page } from "../page";

/** It may as well be the machine of the page that is slow. */
const COARSE = "error × 8within 8 times the error asked for: this page falls behind the run";

it("says in words that a view is coarser, and nothing once it is exact again", () => {
  const { store, greet } = page({ views: [{ name: "surface", kind: "surface" }, { name: "cut", kind: "slice" }] });
  const root = document.createElement("div");
  new ViewList(root, store);
  const notes = (): (string | null)[] => [...root.querySelectorAll<HTMLElement>(".precision")].map((note) => (note.hidden ? "" : note.textContent));
  expect(notes()).toEqual(["", ""]);
  store.dispatch({ type: "precision", view: "cut", coarser: 8 });
  expect(notes()).toEqual(["", COARSE]);
  // It stays where the list changes.
  greet({ views: [{ name: "cut", kind: "slice" }] });
  expect(notes()).toEqual([COARSE]);
  store.dispatch({ type: "precision", view: "cut", coarser: 1 });
  expect(notes()).toEqual([""]);
  store.dispatch({ type: "precision", view: "cut", coarser: 64 });
  store.dispatch({ type: "connection", state: "connected", explanation: "" });
  expect(notes()).toEqual([""]);
});

it("leaves a row as it is, and the focus in it, while other views come and go", () => {
  const views = (...names: string[]) => ({ views: names.map((name) => ({ name, kind: "slice" as const })) });
  const { store, greet } = page(views("shell", "cut", "jet"));
  const root = document.body.appendChild(document.createElement("div"));
  new ViewList(root, store);
  const control = (view: string, act: string): HTMLElement => root.querySelector<HTMLElement>(`[data-view="${view}"] [data-act="${act}"]`)!;
  const slider = control("cut", "opacity");
  slider.focus();
  const removed: Node[] = [];
  const observer = new MutationObserver(() => undefined);
  observer.observe(root, { childList: true });
  greet(views("cut", "worst cells", "jet"));
  for (const record of observer.takeRecords()) removed.push(...record.removedNodes);
  observer.disconnect();
  expect([document.activeElement, control("cut", "opacity"), removed.includes(slider.closest("[data-view]")!)]).toEqual([slider, slider, false]);
  expect([...root.children].map((row) => (row as HTMLElement).dataset.view)).toEqual(["cut", "worst cells", "jet"]);
  control("worst cells", "choose").focus();
  greet(views("cut", "jet"));
  expect(document.activeElement).toBe(control("jet", "choose"));
  greet(views());
  expect([document.activeElement, root.textContent]).toEqual([root, "No views are streamed."]);
  greet(views("cut"));
  expect(root.children).toHaveLength(1);
});

it("says of which stage a view is, not what the run calls everything that is no surface", () => {
  const views = ["shell", "cut", "jet", "worst cells", "line"].map((name) => ({ name, kind: name === "shell" ? "surface" : "slice" }));
  const { store } = page({ views });
  const root = document.createElement("div");
  new ViewList(root, store);
  const kinds = (): string[] => [...root.querySelectorAll<HTMLElement>(".kind")].map((kind) => (kind.hidden ? "" : kind.textContent));
  expect(kinds()).toEqual(["surface", "", "", "", ""]);
  const stages = [{ surface: {} }, { slice: { origin: [0, 0, 0], normal: [1, 0, 0] } }, { threshold: { field: "p", min: 1 } }, { threshold: { field: "q", max: 0 } }, { probe: {} }];
  store.dispatch({ type: "pipelines known", pipelines: views.map(({ name }, i) => ({ name, stages: [{ magnitude: { field: "u" } }, stages[i]!, { stream: {} }] })) });
  expect(kinds()).toEqual(["surface", "slice", "threshold", "", ""]);
});
