// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { STOPS, Tour } from "../../src/panels/tour";
import { openDocument } from "./document";

describe("the tour", () => {
  const ended = vi.fn(), reveal = vi.fn();
  const box = (): HTMLElement => document.getElementById("tour")!;
  const press = (key: string): void => { box().dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true })); };
  beforeEach(() => {
    openDocument();
    vi.clearAllMocks();
  });

  it("has six steps, each about something of the page, and ends with the last", () => {
    new Tour(ended, reveal).begin();
    expect(STOPS).toHaveLength(6);
    for (const [i, { at, title }] of STOPS.entries()) {
      expect(box().textContent).toContain(title);
      expect(box().textContent).toContain(`${i + 1} of 6`);
      expect(reveal).toHaveBeenLastCalledWith(document.getElementById(at));
      expect(ended).not.toHaveBeenCalled();
      press("ArrowRight");
    }
    expect(box().hidden).toBe(true);
    expect(ended).toHaveBeenCalledOnce();
  });

  it("is left by Escape, and gives the focus back", () => {
    const button = document.getElementById("tour-button")!;
    new Tour(ended, reveal);
    button.focus();
    button.click();
    expect(document.activeElement).toBe(box());
    press("ArrowRight");
    press("ArrowLeft");
    press("ArrowLeft");
    expect(box().textContent).toContain("1 of 6");
    press("Escape");
    expect(box().hidden).toBe(true);
    expect(document.activeElement).toBe(button);
    expect(ended).toHaveBeenCalledOnce();
  });
});
