// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { parseServerMessage } from "../../src/connection/protocol";
import type { Person } from "../../src/connection/protocol";
import { PeoplePanel } from "../../src/panels/people";
import { StatusBar } from "../../src/panels/status";
import { WheelPanel } from "../../src/panels/wheel";
import { Kept } from "../../src/store/kept";
import { whyNotSteering } from "../../src/store/run";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

const person = (client: string, name: string | null, more: Partial<Person> = {}): Person => ({ client, name, role: "watcher", may_drive: true, ...more });
const MARKUP = "<img src=x onerror=alert(1)>";

describe("who is here", () => {
  let made: ReturnType<typeof page>;
  let kept: Kept;
  let panel: PeoplePanel;
  let copied: string[];
  let isCopying: boolean;
  const at = <T extends HTMLElement = HTMLButtonElement>(id: string): T => document.getElementById(id) as T;
  const told = (viewers: Person[]): void => made.store.dispatch({ type: "people", viewers });
  const last = (): unknown => made.sent.at(-1);
  beforeEach(() => {
    openDocument();
    made = page();
    kept = new Kept({ getItem: () => JSON.stringify({ name: "Anna" }), setItem: () => undefined }, "/");
    [copied, isCopying] = [[], true];
    new StatusBar(made.store, made.commands);
    new WheelPanel(made.store, made.commands);
    panel = new PeoplePanel(made.store, made.commands, kept, () => "http://127.0.0.1:7070/runs/wing/?view=a#b", (text) => {
      copied.push(text);
      return Promise.resolve(isCopying);
    });
  });

  it("says how this one is called, at once and when it changes, and keeps it", () => {
    expect(made.sent.find((message) => "name" in message)).toMatchObject({ name: { name: "Anna" } });
    const name = at<HTMLInputElement>("own-name");
    expect(name.value).toBe("Anna");
    name.value = "  Bo ";
    name.dispatchEvent(new Event("change"));
    expect([kept.name, last()]).toMatchObject(["Bo", { name: { name: "Bo" } }]);
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    made.store.dispatch({ type: "connection", state: "connected", explanation: "" });
    made.greet({});
    expect(last()).toMatchObject({ name: { name: "Bo" } });
  });

  it("lists names as text, and lets the one who steers hand over and remove", () => {
    told([person("c1", "Anna", { role: "driver" }), person("c2", MARKUP), person("c3", null, { may_drive: false })]);
    const rows = [...document.querySelectorAll("#people-list li")];
    expect(rows.map((row) => row.querySelector(".who")!.textContent)).toEqual(["Annac1 · steers · you", `${MARKUP}c2 · could steer`, "viewer c3watches"]);
    expect(document.querySelector("#people-list img")).toBeNull();
    expect(rows.map((row) => [...row.querySelectorAll("button")].map((button) => button.textContent))).toEqual([[], ["Hand over", "Remove"], ["Remove"]]);
    rows[1]!.querySelector<HTMLElement>('[data-act="hand-over"]')!.click();
    expect(last()).toMatchObject({ hand_over: { to: "c2" } });
    rows[2]!.querySelector<HTMLElement>('[data-act="remove"]')!.click();
    expect(last()).toMatchObject({ kick: { client: "c3" } });
    made.store.dispatch({ type: "wheel asked", by: "c2" });
    expect(at("asked-text").textContent).toBe(`${MARKUP} (c2) asks to steer.`);
    // One who watches has no such buttons, and is told by name who steers.
    made.greet({ role: "watcher" });
    told([person("c1", "Anna"), person("c2", "Bo", { role: "driver" })]);
    made.store.dispatch({ type: "status", status: { ...STATUS, driver: "c2" }, at: 0 });
    expect(document.querySelectorAll("#people-list button").length).toBe(0);
    expect(at("role").textContent).toBe("watching · Bo (c2) steers");
    expect(whyNotSteering(made.store.state)).toBe("Bo (c2) steers: ask to steer first.");
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    expect(made.store.state.people).toEqual([]);
  });

  it("keeps the focus while the list changes", () => {
    told([person("c1", null, { role: "driver" }), person("c2", null), person("c3", null)]);
    at("people").hidden = false;
    const button = (): HTMLElement => document.querySelector<HTMLElement>('li[data-client="c2"] [data-act="remove"]')!;
    button().focus();
    told([person("c1", null, { role: "driver" }), person("c2", "Bo")]);
    expect(document.activeElement).toBe(button());
    told([person("c1", null, { role: "driver" })]);
    expect(document.activeElement).toBe(at("people"));
  });

  it("copies a link that is relative to the page, or shows it to be copied", async () => {
    at("viewers").click();
    expect([at("people").hidden, at("viewers").getAttribute("aria-expanded")]).toEqual([false, "true"]);
    at("link-watch").click();
    const { id } = last() as { id: string };
    expect(last()).toMatchObject({ link: { for: "watch" } });
    await panel.take({ for: "watch", path: "?key=k1", id: "another" });
    expect(copied).toEqual([]);
    await panel.take({ for: "watch", path: "?key=k1", id });
    expect(copied).toEqual(["http://127.0.0.1:7070/runs/wing/?key=k1"]);
    expect(at("link-told").textContent).toBe("Copied. It opens one browser, once, to watch. It leads to 127.0.0.1: elsewhere it needs a tunnel as yours.");
    expect(at("link-text").hidden).toBe(true);
    isCopying = false;
    at("link-drive").click();
    await panel.take({ for: "drive", path: "?key=k2", id: (last() as { id: string }).id });
    const text = at<HTMLInputElement>("link-text");
    expect([text.hidden, text.value, document.activeElement]).toEqual([false, "http://127.0.0.1:7070/runs/wing/?key=k2", text]);
    expect(text.selectionEnd! - text.selectionStart!).toBe(text.value.length);
    expect(at("link-told").textContent).toMatch(/^Copy this link\. It opens one browser, once, and may steer\./);
    // It is not left there.
    at("people").dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", bubbles: true }));
    expect([at("people").hidden, text.value, document.activeElement]).toEqual([true, "", at("viewers")]);
    at("link-drive").click();
    expect(panel.refused((last() as { id: string }).id, "the run ends")).toBe(true);
    expect(at("link-told").textContent).toBe("There is no link: the run ends.");
    expect(panel.refused("another", "x")).toBe(false);
  });

  it("offers a watcher no link for steering, but the camera of the one who steers", () => {
    expect([at("follow-row").hidden, at("link-drive").disabled]).toEqual([true, false]);
    made.greet({ role: "watcher", may_drive: false });
    expect([at("follow-row").hidden, at("link-watch").disabled, at("link-drive").disabled]).toEqual([false, false, true]);
    at("follow").click();
    expect([last(), made.store.state.following]).toMatchObject([{ follow: { on: true } }, true]);
    at("follow").click();
    expect([last(), made.store.state.following]).toMatchObject([{ follow: { on: false } }, false]);
    made.store.dispatch({ type: "end", end: { how: "finished", cycle: 1, time: 1 } });
    expect([at("follow-row").hidden, at("link-watch").disabled]).toEqual([true, true]);
  });

  it("reads what it is told of", () => {
    expect(parseServerMessage('{"people": {"viewers": []}}')).toEqual({ kind: "people", body: { viewers: [] } });
    expect(() => parseServerMessage('{"people": {"viewers": 3}}')).toThrow("no viewers");
  });
});
