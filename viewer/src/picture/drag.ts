/** Dragging the handle or a node of the skeleton, with ctrl held: the form gets the translation that the drag describes. */
import type { Scene } from "./scene";
import type { Selection } from "../store/selection";
import type { Vector } from "../connection/protocol";

/** The drag in three significant digits of its longest component: what is seen is what the form says and what is sent. */
export function translation(from: Vector, to: Vector): Vector {
  const by = [0, 1, 2].map((axis) => to[axis]! - from[axis]!);
  const longest = Math.max(...by.map(Math.abs));
  if (!(longest > 0) || !Number.isFinite(longest)) return [0, 0, 0];
  const power = Math.floor(Math.log10(longest)) - 2;
  const round = (value: number): number => (power <= 0 ? Number(value.toFixed(Math.min(100, -power))) : Math.round(value / 10 ** power) * 10 ** power);
  return by.map((value) => round(value) + 0) as Vector;
}

export interface DragListener {
  /**
   * The translation from where the drag began, parallel to the picture, and the node of the skeleton that is dragged, by its place
   * in the reference; null where the handle is. `step` names the drag.
   */
  moved(by: Vector, node: Vector | null, step: string): void;
  /** The drag was given up with Escape: all that it did is to be taken back. */
  aborted(step: string): void;
}

let drags = 0;

export function watchDrags(stage: HTMLElement, scene: Scene, selection: Selection, listener: DragListener): void {
  let from: { pointer: number; point: Vector; node: Vector | null; step: string } | null = null;
  const end = (): void => {
    scene.holdNode(null);
    from = null;
  };
  window.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !from) return;
    event.stopPropagation();
    const { step } = from;
    end();
    listener.aborted(step);
  }, true);
  // Before the camera sees them.
  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !(event.ctrlKey || event.metaKey)) return;
    const node = scene.nodeAt(event.clientX, event.clientY);
    const picked = node ? null : scene.pick(event.clientX, event.clientY);
    if (!node && !picked) return;
    event.stopPropagation();
    event.preventDefault();
    if (picked && selection.get(picked.feature) !== "handle") selection.set(picked.feature, "handle");
    from = { pointer: event.pointerId, point: node?.now ?? picked!.point, node: node?.reference ?? null, step: `drag ${++drags}` };
    if (node) scene.holdNode(node.now);
    stage.setPointerCapture(event.pointerId);
  }, true);
  stage.addEventListener("pointermove", (event) => {
    if (from?.pointer !== event.pointerId) return;
    event.stopPropagation();
    const to = scene.pointAt(event.clientX, event.clientY, from.point);
    if (from.node) scene.holdNode(to);
    listener.moved(translation(from.point, to), from.node, from.step);
  }, true);
  for (const kind of ["pointerup", "pointercancel"] as const) {
    stage.addEventListener(kind, (event) => {
      if (from?.pointer !== event.pointerId) return;
      event.stopPropagation();
      end();
    }, true);
  }
}
