/** The panels at the sides of a narrow page: drawers over the picture, one at a time. */
import { part } from "../dom";

const SIDES = ["left", "right"] as const;
type Side = (typeof SIDES)[number];

/** Gives back what opens the drawer that an element lies in, and closes the other. */
export function watchDrawers(): (target: HTMLElement) => void {
  const open = (side: Side | null): void => {
    document.body.dataset.drawer = side ?? "";
    for (const other of SIDES) part(`${other}-drawer`).setAttribute("aria-expanded", String(side === other));
  };
  for (const side of SIDES) {
    part(`${side}-drawer`).addEventListener("click", () => open(document.body.dataset.drawer === side ? null : side));
    part(side).addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || (document.body.dataset.drawer ?? "") === "" || event.defaultPrevented) return;
      event.preventDefault();
      open(null);
      part(`${side}-drawer`).focus();
    });
  }
  // A hidden button cannot have the focus.
  part("to-apply").addEventListener("click", () => open("right"), true);
  open(null);
  return (target) => open(SIDES.find((side) => part(side).contains(target)) ?? null);
}
