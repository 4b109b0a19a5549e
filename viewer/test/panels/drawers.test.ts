// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchDrawers } from "../../src/panels/drawers";
import { openDocument } from "./document";

describe("the drawers of a narrow page", () => {
  let reveal: (target: HTMLElement) => void;
  const at = (id: string): HTMLElement => document.getElementById(id)!;
  /** The drawer that is open, and what the buttons say of both. */
  const shown = (): unknown[] => [document.body.dataset.drawer, ...["left", "right"].map((side) => at(`${side}-drawer`).getAttribute("aria-expanded"))];
  const escape = (target: HTMLElement): KeyboardEvent => {
    const event = new KeyboardEvent("keydown", { key: "Escape", bubbles: true, cancelable: true });
    target.dispatchEvent(event);
    return event;
  };
  beforeEach(() => {
    openDocument();
    document.body.dataset.drawer = "left";
    reveal = watchDrawers();
  });

  it("are closed at first, and opened one at a time", () => {
    expect(shown()).toEqual(["", "false", "false"]);
    at("left-drawer").click();
    expect(shown()).toEqual(["left", "true", "false"]);
    at("right-drawer").click();
    expect(shown()).toEqual(["right", "false", "true"]);
    at("right-drawer").click();
    expect(shown()).toEqual(["", "false", "false"]);
  });

  it("are closed with Escape, which gives the focus back to the button", () => {
    at("right-drawer").click();
    at("amount").focus();
    const { defaultPrevented } = escape(at("amount"));
    expect([shown(), document.activeElement, defaultPrevented]).toEqual([["", "false", "false"], at("right-drawer"), true]);
  });

  it("leave an Escape alone that something in them has taken, or that comes while both are closed", () => {
    at("left-drawer").click();
    at("pipeline-text").addEventListener("keydown", (event) => event.preventDefault());
    escape(at("pipeline-text"));
    expect(shown()).toEqual(["left", "true", "false"]);
    at("left-drawer").click();
    at("own-name").focus();
    escape(at("views"));
    expect(document.activeElement).toBe(at("own-name"));
  });

  it("open for what is to be seen in them, and close for what is in neither", () => {
    reveal(at("notes"));
    expect(shown()).toEqual(["left", "true", "false"]);
    reveal(at("foot"));
    expect(shown()).toEqual(["right", "false", "true"]);
    reveal(at("scene"));
    expect(shown()).toEqual(["", "false", "false"]);
  });

  it("open for the way to Apply before that gets the focus", () => {
    let before = "";
    at("to-apply").addEventListener("click", () => { before = document.body.dataset.drawer ?? ""; });
    at("to-apply").click();
    expect(before).toBe("right");
  });
});
