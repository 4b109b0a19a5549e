/** The handle as something to grip: the features that are chosen for it, at the middle of their box. */
import type { Vector } from "../connection/protocol";
import { chosen, kindOf, partsOf } from "../store/draft";
import type { State } from "../store/state";
import type { Composer } from "./gesture";
import { HandleBox, middleOf } from "./handle-box";
import type { ShownSurface } from "./handle-box";
import type { Target } from "./handles";
import type { Place } from "./projection";
import { ShapeComposer, baseOf, movedCenter, poseOf } from "./shape-composer";
import { subtract } from "./vector";

/** Faces that are chosen one by one as the handle. */
export interface ShapeRegion {
  /** Whether faces are being chosen: nothing is gripped then. */
  readonly isActive: boolean;
  readonly hasRegion: boolean;
  /** The box around the handle; null where it is not known. */
  bounds(): [Vector, Vector] | null;
  /** The point of the chosen faces that is seen at a place of the picture; null for none. */
  pick(place: Place): Vector | null;
}

export class ShapeTarget implements Target {
  readonly kinds = ["ring", "plane", "arrow", "box"] as const;
  private readonly box = new HandleBox();

  constructor(private readonly state: () => State, private readonly surfaces: () => Iterable<ShownSurface>, readonly region: ShapeRegion) {}

  /** The middle of the handle before what stands in the form. */
  private middle(): Vector | null {
    const state = this.state();
    if (!kindOf(state, "translate") || this.region.isActive) return null;
    const names = (state.hello?.features ?? []).map((feature) => feature.name);
    const bounds = this.region.hasRegion ? this.region.bounds() : this.box.bounds(this.surfaces(), names, chosen(state, "handle"));
    if (!bounds) return null;
    const middle = middleOf(bounds);
    const { updating } = state.draft;
    const now = updating === null ? null : partsOf(state.hello?.stack[updating]);
    // The shape that is has the edit already which is being changed.
    const pose = now && poseOf({ key: now.key, bodies: { [now.key]: now.body }, isNeutral: false }, middle);
    return pose ? subtract(middle, pose.translation) : middle;
  }

  center(): Vector | null {
    const middle = this.middle();
    return middle && movedCenter(baseOf(this.state()), middle);
  }

  begin(): Composer | null {
    const middle = this.middle();
    return middle && new ShapeComposer(baseOf(this.state()), middle);
  }

  unit(): string {
    return lengthUnit(this.state());
  }
}

/** The unit of a translation, as the schema says it; empty where it says only that it is the mesh's own. */
export function lengthUnit(state: State): string {
  const kind = kindOf(state, "translate");
  const unit = kind?.field.kind === "object" ? kind.field.properties.find(({ name }) => name === "by")?.unit ?? "" : "";
  return unit === "mesh units" ? "" : unit;
}
