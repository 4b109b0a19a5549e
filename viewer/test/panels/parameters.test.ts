// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { ParameterPanel } from "../../src/panels/parameters";
import { page } from "../page";
import { openDocument } from "./document";

const inflow = (value: number) => ({ name: "inflow_speed", value, minimum: 0, maximum: 20 });

describe("the parameters", () => {
  let made: ReturnType<typeof page>;
  let panel: ParameterPanel;
  const input = (): HTMLInputElement => document.querySelector<HTMLInputElement>('[data-parameter="inflow_speed"]')!;
  const wrong = (): HTMLElement => document.querySelector<HTMLElement>("#parameters .wrong")!;
  const set = (text: string): void => {
    input().value = text;
    input().dispatchEvent(new Event("change"));
  };
  beforeEach(() => {
    openDocument();
    made = page({ parameters: [inflow(10)] });
    panel = new ParameterPanel(document.getElementById("parameters")!, made.store, made.commands);
  });

  it("say beside them what is wrong, and send nothing then", () => {
    set("fast");
    expect([wrong().hidden, wrong().textContent]).toEqual([false, "inflow speed “fast” is not a number"]);
    set("30");
    expect(wrong().textContent).toBe("inflow speed must be at most 20");
    expect(made.sent).toEqual([]);
    set("12");
    expect(wrong().hidden).toBe(true);
    expect(made.sent[0]).toMatchObject({ parameter: { name: "inflow_speed", value: 12 } });
  });

  it("say beside them what the simulation refuses, and leave other errors alone", () => {
    set("12");
    expect(panel.refused("other", "no")).toBe(false);
    expect(panel.refused(String(made.sent[0]!.id), "the journal cannot be written")).toBe(true);
    expect(wrong().textContent).toBe("the journal cannot be written");
  });

  it("follow the simulation, but not under a hand", () => {
    made.greet({ parameters: [inflow(11)] });
    expect(input().value).toBe("11");
    input().focus();
    input().value = "1";
    made.greet({ parameters: [inflow(14)] });
    expect(input().value).toBe("1");
  });

  it("are off for a watcher, with the reason", () => {
    made.greet({ role: "watcher", may_drive: false });
    expect([input().disabled, input().title]).toEqual([true, "This link is for watching only."]);
  });
});
