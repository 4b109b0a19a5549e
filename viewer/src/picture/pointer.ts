/** Picking with the pointer: hovering names a feature, a click makes it a handle, a click with shift holds it fixed. */
import { part, write } from "../dom";
import { showTip } from "./overlay";
import type { Places } from "./places";
import type { Selection } from "../store/selection";

const CLICK_DISTANCE = 4;
/** What is said beside the pointer where a tool waits for a place and a click has met none. */
const MISSED = "That click met nothing: click on the model.";

export interface PointerListener {
  /** What stands beside the pointer below the name of the feature; empty for nothing. */
  reading(clientX: number, clientY: number): string;
  /** The tool that takes clicks in place of features: called with a place of the page, it returns whether that met the model. Null where none is on. */
  tool(): ((clientX: number, clientY: number) => boolean) | null;
}

export function watchPointer(stage: HTMLElement, places: Pick<Places, "featureAt">, selection: Selection, listener: PointerListener): void {
  /** Readers of the screen are told what is a message; what the pointer passes over would never let them rest. */
  const announcer = part("announcer");
  let down: { x: number; y: number } | null = null;
  let dragging = false;
  let last: PointerEvent | null = null;
  let scheduled = false;
  /** Whether the last click has met nothing, and the tool still waits for another. */
  let missed = false;

  const hover = (): void => {
    scheduled = false;
    if (!last || dragging) return;
    const feature = places.featureAt(last.clientX, last.clientY);
    selection.hovered = feature;
    const role = feature ? selection.get(feature) : null;
    missed &&= listener.tool() !== null;
    const lines = [missed ? MISSED : "", feature ? `${feature}${role ? ` · ${role}` : ""}` : "", listener.reading(last.clientX, last.clientY)].filter((line) => line !== "");
    showTip(lines.length > 0 ? lines.join("\n") : null, last.clientX, last.clientY);
    stage.style.cursor = feature ? "pointer" : "";
  };
  const schedule = (): void => {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(hover);
  };

  stage.addEventListener("pointermove", (event) => {
    last = event;
    if (down && Math.hypot(event.clientX - down.x, event.clientY - down.y) > CLICK_DISTANCE) {
      dragging = true;
      selection.hovered = null;
      showTip(null, 0, 0);
    }
    schedule();
  });
  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    down = { x: event.clientX, y: event.clientY };
    if (missed) {
      showTip(null, 0, 0);
      // The next miss is another one, which is told again.
      if (announcer.textContent === MISSED) write(announcer, "");
    }
    missed = false;
  });
  window.addEventListener("pointerup", (event) => {
    const clicked = down !== null && !dragging && event.button === 0;
    down = null;
    dragging = false;
    if (!clicked) return;
    const tool = listener.tool();
    if (tool) {
      missed = !tool(event.clientX, event.clientY);
      if (missed) write(announcer, MISSED);
      last = event;
      // A miss at once: a finger that is lifted is not there any more.
      return missed ? hover() : schedule();
    }
    const feature = places.featureAt(event.clientX, event.clientY);
    if (feature) selection.toggle(feature, event.shiftKey ? "fixed" : "handle");
    last = event;
    schedule();
  });
  stage.addEventListener("pointerleave", (event) => {
    last = null;
    selection.hovered = null;
    // A finger leaves with each click, and what is said of that stays.
    if (!missed || event.pointerType !== "touch") showTip(null, 0, 0);
  });
}
