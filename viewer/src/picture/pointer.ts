/** Picking with the pointer: hovering names a feature, a click makes it a handle, a click with shift holds it fixed. */
import { showTip } from "./overlay";
import type { Scene } from "./scene";
import type { Selection } from "../store/selection";

const CLICK_DISTANCE = 4;

export interface PointerListener {
  /** What stands beside the pointer below the name of the feature; empty for nothing. */
  reading(clientX: number, clientY: number): string;
  /** A click at a place of the page; true where it was meant for something else than a feature. */
  clicked(clientX: number, clientY: number): boolean;
}

export function watchPointer(stage: HTMLElement, scene: Scene, selection: Selection, listener: PointerListener): void {
  let down: { x: number; y: number } | null = null;
  let dragging = false;
  let last: PointerEvent | null = null;
  let scheduled = false;

  const hover = (): void => {
    scheduled = false;
    if (!last || dragging) return;
    const feature = scene.featureAt(last.clientX, last.clientY);
    selection.hovered = feature;
    const role = feature ? selection.get(feature) : null;
    const lines = [feature ? `${feature}${role ? ` · ${role}` : ""}` : "", listener.reading(last.clientX, last.clientY)].filter((line) => line !== "");
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
    if (event.button === 0) down = { x: event.clientX, y: event.clientY };
  });
  window.addEventListener("pointerup", (event) => {
    const clicked = down !== null && !dragging && event.button === 0;
    down = null;
    dragging = false;
    if (!clicked || listener.clicked(event.clientX, event.clientY)) return;
    const feature = scene.featureAt(event.clientX, event.clientY);
    if (feature) selection.toggle(feature, event.shiftKey ? "fixed" : "handle");
    last = event;
    schedule();
  });
  stage.addEventListener("pointerleave", () => {
    last = null;
    selection.hovered = null;
    showTip(null, 0, 0);
  });
}
