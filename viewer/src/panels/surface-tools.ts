/** The buttons of what works on the surface from which shapes are measured, Skeleton and Faces: where there is none they are off, and say why. */
import { part } from "../dom";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";

/** What shows the skeleton, and hears why there is none. */
export interface SkeletonShower {
  showSkeleton(shown: boolean): void;
  noSkeleton: (reason: string) => void;
}

/** Why there is no surface to work on, in words; empty where there is one. */
function whyNoSurface({ hello }: State): string {
  if (!hello) return "There is no connection to the simulation.";
  if (hello.surface) return "";
  if (hello.recording) return "This is a recording: the surface from which shapes are measured is not in it.";
  return "There is no surface to shape: the run has not taken its first step, or has a mesh whose shape cannot be changed.";
}

export function watchSurfaceTools(store: Store<State, Action>, shower: SkeletonShower, trouble: (text: string) => void): void {
  const buttons = ["skeleton", "faces"].map((id) => part(id) as HTMLButtonElement);
  const [skeleton] = buttons as [HTMLButtonElement];
  const isOn = (button: HTMLButtonElement): boolean => button.getAttribute("aria-pressed") === "true";
  skeleton.addEventListener("click", () => {
    const shown = !isOn(skeleton);
    skeleton.setAttribute("aria-pressed", String(shown));
    shower.showSkeleton(shown);
  });
  shower.noSkeleton = (reason) => {
    skeleton.setAttribute("aria-pressed", "false");
    trouble(`there is no skeleton: ${reason}`);
  };
  const titles = buttons.map(({ title }) => title);
  store.watch(whyNoSurface, (why) => buttons.forEach((button, i) => {
    // What is on goes with the surface.
    if (why !== "" && isOn(button)) button.click();
    button.disabled = why !== "";
    button.title = why || titles[i]!;
  }));
}
