/** What a drag comes to: a translation, an angle or a factor, along what it is locked to and nothing else. */
import type { Vector } from "../connection/protocol";
import { ringTangent } from "./gizmo";
import type { GizmoPart } from "./gizmo";
import { closestAlong, meetPlane } from "./projection";
import type { Place, Projection } from "./projection";
import { AXES, across, cross, dot, subtract, times, unit } from "./vector";
import type { Axis } from "./vector";

/** What a drag is locked to: a part of the gizmo, or the plane of the picture. */
export type Lock = GizmoPart | { kind: "free" };

/** A translation, an angle in degrees about an axis, or a factor along one. */
export type Amount = { kind: "move"; by: Vector } | { kind: "turn"; degrees: number } | { kind: "scale"; factor: number };

/** Where the drag began: the middle of the gizmo, the point that was gripped, and its place in the picture. */
export interface Grip { center: Vector; point: Vector; place: Place }

/** A factor below this would flatten the handle; it can be typed. */
const LEAST_FACTOR = 0.01;
/** A ring that is seen so much from its edge is turned along its tangent. */
const EDGE_ON = 0.2;

/** Another lock of the kind that a lock is of, on an axis; with `isAcross` a translation in the plane across it. */
export function locked(lock: Lock, axis: Axis, isAcross: boolean): Lock {
  if (lock.kind === "ring" || lock.kind === "box") return { kind: lock.kind, axis };
  return { kind: isAcross ? "plane" : "arrow", axis };
}

/** The axes along which a lock lets a translation go. */
export function axesOf(lock: Lock): readonly Axis[] {
  return lock.kind === "free" ? AXES : lock.kind === "plane" ? across(lock.axis) : [lock.axis];
}

/** What a drag from the grip to a place comes to; null where the picture does not say. `before` is the angle so far. */
export function measure(projection: Projection, lock: Lock, grip: Grip, to: Place, before = 0): Amount | null {
  const [from, now] = [projection.ray(grip.place), projection.ray(to)];
  switch (lock.kind) {
    case "free": return moved(meetPlane(from, grip.point, projection.direction), meetPlane(now, grip.point, projection.direction), AXES);
    case "plane": return moved(meetPlane(from, grip.center, unit(lock.axis)), meetPlane(now, grip.center, unit(lock.axis)), across(lock.axis));
    case "arrow": {
      const [a, b] = [closestAlong(from, grip.center, unit(lock.axis)), closestAlong(now, grip.center, unit(lock.axis))];
      return a === null || b === null ? null : { kind: "move", by: times(unit(lock.axis), b - a) };
    }
    case "box": {
      const [a, b] = [closestAlong(from, grip.center, unit(lock.axis)), closestAlong(now, grip.center, unit(lock.axis))];
      return a === null || b === null || a === 0 ? null : { kind: "scale", factor: Math.max(LEAST_FACTOR, b / a) };
    }
    case "ring": {
      const degrees = turned(projection, lock.axis, grip, to);
      // A turn may go round more than once: the nearest angle to the one before is meant.
      return degrees === null ? null : { kind: "turn", degrees: degrees + 360 * Math.round((before - degrees) / 360) };
    }
  }
}

/** The translation from a point to another, exactly 0 across the axes that are let go. */
function moved(from: Vector | null, to: Vector | null, axes: readonly Axis[]): Amount | null {
  if (!from || !to) return null;
  return { kind: "move", by: AXES.map((axis) => (axes.includes(axis) ? to[axis] - from[axis] : 0)) as Vector };
}

function turned(projection: Projection, axis: Axis, { center, place }: Grip, to: Place): number | null {
  const normal = unit(axis);
  const [from, now] = [meetPlane(projection.ray(place), center, normal), meetPlane(projection.ray(to), center, normal)];
  if (Math.abs(dot(projection.direction, normal)) < EDGE_ON || !from || !now) {
    // The side of the ring that is turned to the viewer.
    const facing = subtract(times(projection.direction, -1), times(normal, -dot(projection.direction, normal)));
    const ring = ringTangent(projection, center, axis, times(facing, projection.pixel(center)));
    if (!ring) return null;
    const along = (to[0] - place[0]) * ring.tangent[0] + (to[1] - place[1]) * ring.tangent[1];
    return (along / ring.radius) * (180 / Math.PI);
  }
  const [a, b] = [subtract(from, center), subtract(now, center)];
  return Math.atan2(dot(normal, cross(a, b)), dot(a, b)) * (180 / Math.PI);
}
