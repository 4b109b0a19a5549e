/** Picking with the pointer: hovering names a feature, a click makes it a handle, a click with shift holds it fixed. */
import { showTip } from "./overlay";
import type { Scene } from "./scene";
import type { Selection } from "../store/selection";

const CLICK_DISTANCE = 4;

export function watchPointer(stage: HTMLElement, scene: Scene, selection: Selection): void {
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
    showTip(feature ? `${feature}${role ? ` · ${role}` : ""}` : null, last.clientX, last.clientY);
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
    if (!clicked) return;
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
