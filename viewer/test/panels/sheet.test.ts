// @vitest-environment jsdom
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { ClickTools, OnePlace } from "../../src/panels/click-tools";
import { EditsPanel } from "../../src/panels/edits";
import { watchKeys } from "../../src/panels/keys";
import { watchPictureTools } from "../../src/panels/tools";
import { Camera } from "../../src/picture/camera";
import { page } from "../page";
import { openDocument } from "./document";

interface Key { key: string; shiftKey: boolean; ctrlKey: boolean; altKey: boolean }
const NAMES: Readonly<Record<string, string>> = { "←": "ArrowLeft", "→": "ArrowRight", "↑": "ArrowUp", "↓": "ArrowDown", "−": "-", Esc: "Escape" };
/** Keys of a handle in the picture, which another test presses (`handles/gesture.test.ts` those of a drag). */
const OF_HANDLES = ["G", "T", "E"];
/** Keys of the history alone, which `history/plots.test.ts` presses. */
const OF_HISTORY = ["0"];
/** Another way to write one that is listed, where a keyboard has it without shift. */
const ALIKE: Readonly<Record<string, string>> = { "=": "+" };

/** A key as the sheet writes it; what is held beside Esc changes nothing, and beside Enter ctrl alone does. */
function written({ key, ...held }: Key): string {
  const isOpen = key !== "Enter" && key !== "Escape";
  const [shiftKey, altKey, ctrlKey] = [held.shiftKey && isOpen, held.altKey && isOpen, held.ctrlKey && key !== "Escape"];
  const name = Object.entries(NAMES).find(([, known]) => known === key)?.[0] ?? (key.length === 1 ? key.toUpperCase() : key);
  return [ctrlKey ? "ctrl" : "", altKey ? "alt" : "", shiftKey ? "shift" : "", ALIKE[name] ?? name].filter(Boolean).join(" ");
}

/** All keys that a keyboard has for letters, signs and ways, alone and with what is held beside. */
function* keys(): Generator<Key> {
  const plain = { shiftKey: false, ctrlKey: false, altKey: false };
  for (const key of [..."abcdefghijklmnopqrstuvwxyz0123456789+-=?.,", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Enter", "Escape", "Home", "End", "PageUp", "PageDown", " "]) {
    const isSign = /^[^a-z]$/.test(key);
    yield { ...plain, key };
    // A sign with shift is another one.
    if (!isSign) yield { ...plain, key: key.length === 1 ? key.toUpperCase() : key, shiftKey: true };
    for (const shiftKey of [false, true]) yield { ...plain, key: shiftKey && key.length === 1 ? key.toUpperCase() : key, ctrlKey: true, shiftKey };
    yield { ...plain, key, altKey: true };
  }
}

describe("the sheet of keys", () => {
  let heard: ReturnType<typeof vi.spyOn>;
  let made: ReturnType<typeof page>;
  beforeEach(() => {
    openDocument();
    heard = vi.spyOn(window, "addEventListener");
    made = page({ stack: [1, 2].map((x) => ({ translate: { features: ["wall"], by: [x, 0, 0] } })) });
    const scene = document.getElementById("scene")!;
    const camera = new Camera(vtkRenderer.newInstance(), {} as never, () => null, () => undefined, () => undefined);
    scene.addEventListener("keydown", (event) => { camera.key(event); });
    const nothing = (): void => undefined;
    watchPictureTools(scene, document.getElementById("stage")!, { pin: () => true, unpin: nothing, use: nothing, save: nothing, movie: nothing });
    watchKeys(made.store, made.commands);
    new EditsPanel(made.store, made.commands);
    const tools = new ClickTools(scene, [new OnePlace("pin", () => true)]);
    // A tool waits, an edit stands in the form, and whatever is taken back can be brought back.
    held = () => {
      if (!tools.current) tools.use("pin");
      (document.getElementById("apply") as HTMLButtonElement).disabled = false;
      made.store.dispatch({ type: "composed", key: "translate", values: { by: [2, 0, 0] }, step: `step ${made.store.state.draft.past.length}` });
    };
    HTMLDialogElement.prototype.showModal ??= nothing;
    document.getElementById("apply")!.addEventListener("click", (event) => event.preventDefault());
  });
  let held: () => void;
  afterEach(() => {
    for (const [name, listener] of heard.mock.calls as [string, EventListener][]) window.removeEventListener(name, listener);
    heard.mockRestore();
  });
  const isHandled = (key: Key): boolean => ["#scene", '#stack [data-edit="0"] [data-act="load"]'].some((place) => {
    held();
    const event = new KeyboardEvent("keydown", { ...key, bubbles: true, cancelable: true });
    document.querySelector(place)!.dispatchEvent(event);
    return event.defaultPrevented;
  });

  it("has every key that does something, and none that does nothing", () => {
    const listed = new Set([...document.querySelectorAll("#keys kbd")].map(({ textContent }) => textContent));
    const doing = new Set([...keys()].filter(isHandled).map(written));
    for (const name of [...OF_HANDLES, ...OF_HISTORY]) {
      expect(doing.has(name), name).toBe(false);
      doing.add(name);
    }
    expect([...doing].sort()).toEqual([...listed].sort());
  });
});
