/** Presses that were kept from the camera until a second finger has said that both are meant for it. */

const given = new WeakSet<Event>();

/** Tells of a press anew, which the camera has not seen; `at` is where, where that is not what was pressed. */
export function giveToCamera(down: PointerEvent, at: EventTarget | null = down.target): void {
  const again = new PointerEvent(down.type, down);
  given.add(again);
  at?.dispatchEvent(again);
}

/** Whether a press is such a one: whatever else could be done with it makes way. */
export const isForCamera = (down: PointerEvent): boolean => given.has(down);
