// @vitest-environment jsdom
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { element } from "../../src/dom";
import { Handles } from "../../src/handles/handles";
import { Overlay } from "../../src/handles/overlay";
import { ShapeTarget } from "../../src/handles/shape-target";
import { watchPlot } from "../../src/history/plot-control";
import { ClickTools, OnePlace } from "../../src/panels/click-tools";
import { EditsPanel } from "../../src/panels/edits";
import { watchKeys } from "../../src/panels/keys";
import { watchPictureTools } from "../../src/panels/tools";
import { Camera } from "../../src/picture/camera";
import { Selection } from "../../src/store/selection";
import { OBLIQUE } from "../handles/cameras";
import { page } from "../page";
import { openDocument } from "./document";

/** A triangle of the feature "throat", which is the handle. */
const SURFACE = {
  topology: { kind: "topology" as const, view: "walls", topology: "t", points: 3, triangles: Uint32Array.of(0, 1, 2), triangleFeatures: Uint32Array.of(3), lines: new Uint32Array(0) },
  coordinates: Float32Array.of(-0.5, -0.5, -0.5, 0.5, 0.5, -0.5, 0, 0, 0.5),
};

interface Key { key: string; shiftKey: boolean; ctrlKey: boolean; altKey: boolean }
const NAMES: Readonly<Record<string, string>> = { "←": "ArrowLeft", "→": "ArrowRight", "↑": "ArrowUp", "↓": "ArrowDown", "−": "-", Esc: "Escape" };
/** Keys that do the same whatever is held beside them; ctrl changes what Enter does. */
const SAME = ["Enter", "Escape", "Home", "End"];
/** Another way to write one that is listed, where a keyboard has it without shift. */
const ALIKE: Readonly<Record<string, string>> = { "=": "+" };

/** A key as the sheet writes it. */
function written({ key, ...held }: Key): string {
  const isOpen = !SAME.includes(key);
  const [shiftKey, altKey, ctrlKey] = [held.shiftKey && isOpen, held.altKey && isOpen, held.ctrlKey && (isOpen || key === "Enter")];
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
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    const picture = { projection: () => OBLIQUE, pick: () => null, shownBones: null };
    const shape = new ShapeTarget(() => made.store.state, () => [SURFACE], { isActive: false, hasRegion: false, bounds: () => null, pick: () => null });
    const handles = new Handles(document.getElementById("stage")!, scene, picture, made.store, new Selection(made.store), shape, new Overlay(scene, null), document.getElementById("tools")!);
    const plot = element("div", { id: "plot" });
    document.body.append(plot);
    watchPlot(plot, () => null, { zoomBy: nothing, whole: nothing, step: nothing, cursor: () => 0.5, release: nothing, point: nothing, pinchBegun: nothing, pinch: nothing });
    // No number is typed, a tool waits, an edit stands in the form, and whatever is taken back can be brought back.
    held = () => {
      handles.finish();
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
  const isHandled = (key: Key): boolean => ["#scene", "#plot", '#stack [data-edit="0"] [data-act="load"]'].some((place) => {
    held();
    const event = new KeyboardEvent("keydown", { ...key, bubbles: true, cancelable: true });
    document.querySelector(place)!.dispatchEvent(event);
    return event.defaultPrevented;
  });

  it("has every key that does something, and none that does nothing", () => {
    const listed = new Set([...document.querySelectorAll("#keys kbd")].map(({ textContent }) => textContent));
    const doing = new Set([...keys()].filter(isHandled).map(written));
    expect([...doing].sort()).toEqual([...listed].sort());
  });
});
