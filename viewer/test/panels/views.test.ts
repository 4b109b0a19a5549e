// @vitest-environment jsdom
import { expect, it } from "vitest";
import { ViewList } from "../../src/panels/views";
import { page } from "../page";

it("says in words that a view is coarser, and nothing once it is exact again", () => {
  const { store, greet } = page({ views: [{ name: "surface", kind: "surface" }, { name: "cut", kind: "slice" }] });
  const root = document.createElement("div");
  new ViewList(root, store);
  const notes = (): (string | null)[] => [...root.querySelectorAll<HTMLElement>(".precision")].map((note) => (note.hidden ? "" : note.textContent));
  expect(notes()).toEqual(["", ""]);
  store.dispatch({ type: "precision", view: "cut", coarser: 8 });
  expect(notes()).toEqual(["", "slow connection: values within 8 times the error"]);
  // It stays where the list changes.
  greet({ views: [{ name: "cut", kind: "slice" }] });
  expect(notes()).toEqual(["slow connection: values within 8 times the error"]);
  store.dispatch({ type: "precision", view: "cut", coarser: 1 });
  expect(notes()).toEqual([""]);
  store.dispatch({ type: "precision", view: "cut", coarser: 64 });
  store.dispatch({ type: "connection", state: "connected", explanation: "" });
  expect(notes()).toEqual([""]);
});
