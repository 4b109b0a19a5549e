import { describe, expect, it } from "vitest";
import { Gesture, amountText, typedAmount } from "../../src/handles/gesture";
import { measure } from "../../src/handles/motion";
import type { Lock } from "../../src/handles/motion";
import type { Place, Projection } from "../../src/handles/projection";
import { roundStep, rounded, stepOf, toStep } from "../../src/handles/rounding";
import { ShapeComposer } from "../../src/handles/shape-composer";
import type { Base } from "../../src/handles/shape-composer";
import { add, times, turn, transformed, unit } from "../../src/handles/vector";
import type { Axis } from "../../src/handles/vector";
import type { Vector } from "../../src/connection/protocol";
import { ALONG_X, OBLIQUE, PARALLEL } from "./cameras";

const ORIGIN: Vector = [0, 0, 0];
const NEUTRAL: Base = { key: "scale_direction", bodies: {}, isNeutral: true };
const COARSE = { fine: false, snap: false };
const at = (projection: Projection, point: Vector): Place => projection.toPicture(point)!;
const gestureOn = (projection: Projection, lock: Lock, point: Vector, base = NEUTRAL): Gesture =>
  new Gesture("g", new ShapeComposer(base, ORIGIN), lock, point, at(projection, point));

describe("what a drag comes to", () => {
  it("is along the locked axis, to the pixel, and exactly 0 across it", () => {
    for (const projection of [OBLIQUE, PARALLEL]) {
      for (const axis of [0, 1, 2] as Axis[]) {
        const from = times(unit(axis), 0.3);
        const grip = { center: ORIGIN, point: from, place: at(projection, from) };
        const amount = measure(projection, { kind: "arrow", axis }, grip, at(projection, times(unit(axis), 0.8)));
        const by = amount?.kind === "move" ? amount.by : null;
        expect(by![axis]).toBeCloseTo(0.5, 6);
        for (const other of [0, 1, 2]) if (other !== axis) expect(by![other]).toBe(0);
        const aside = measure(projection, { kind: "arrow", axis }, grip, [grip.place[0] + 7, grip.place[1] - 31]);
        expect(aside?.kind === "move" && aside.by.filter((value) => value !== 0).length).toBe(1);
      }
    }
  });

  it("stays in the plane of a plane, and in that of the picture", () => {
    const grip = { center: ORIGIN, point: ORIGIN, place: at(OBLIQUE, ORIGIN) };
    const inPlane = measure(OBLIQUE, { kind: "plane", axis: 2 }, grip, at(OBLIQUE, [0.4, -0.2, 0]));
    expect(inPlane).toEqual({ kind: "move", by: [expect.closeTo(0.4, 6), expect.closeTo(-0.2, 6), 0] });
    const free = measure(ALONG_X, { kind: "free" }, { center: ORIGIN, point: ORIGIN, place: at(ALONG_X, ORIGIN) }, at(ALONG_X, [0, 0.2, 0.1]));
    expect(rounded(free!, { kind: "free" }, 0.001)).toEqual({ kind: "move", by: [0, 0.2, 0.1] });
  });

  it("is the angle about the axis, by the right hand, also more than once round and from the edge of the ring", () => {
    for (const projection of [OBLIQUE, PARALLEL]) {
      for (const axis of [0, 1, 2] as Axis[]) {
        const away = times(unit(((axis + 1) % 3) as Axis), 0.5);
        const grip = { center: ORIGIN, point: away, place: at(projection, away) };
        let degrees = 0;
        for (let i = 1; i <= 40; i++) {
          const amount = measure(projection, { kind: "ring", axis }, grip, at(projection, transformed(turn(unit(axis), 10 * i), away)), degrees);
          degrees = amount?.kind === "turn" ? amount.degrees : NaN;
          expect(degrees).toBeCloseTo(10 * i, 5);
        }
      }
    }
    // Seen along x the ring about z is a line: what is nearer goes to the right as it turns counter-clockwise seen from above.
    const grip = { center: ORIGIN, point: ORIGIN, place: at(ALONG_X, ORIGIN) };
    const amount = measure(ALONG_X, { kind: "ring", axis: 2 }, grip, [grip.place[0] + 76, grip.place[1]]);
    expect(amount?.kind === "turn" ? amount.degrees : NaN).toBeCloseTo(180 / Math.PI, 0);
  });

  it("is the factor that the box is dragged to, never below nothing", () => {
    const from: Vector = [0, 0, 0.4];
    const grip = { center: ORIGIN, point: from, place: at(OBLIQUE, from) };
    const half = measure(OBLIQUE, { kind: "box", axis: 2 }, grip, at(OBLIQUE, [0, 0, 0.2]));
    expect(half?.kind === "scale" ? half.factor : NaN).toBeCloseTo(0.5, 6);
    const through = measure(OBLIQUE, { kind: "box", axis: 2 }, grip, at(OBLIQUE, [0, 0, -0.3]));
    expect(through).toEqual({ kind: "scale", factor: 0.01 });
  });
});

describe("round numbers", () => {
  it("are 1, 2 or 5 times a power of ten for steps, without dust", () => {
    expect([0.0031, 0.05, 0.06, 7, 1].map(roundStep)).toEqual([0.005, 0.05, 0.1, 10, 1]);
    expect(toStep(0.30000000000000004, 0.1)).toBe(0.3);
    expect(Object.is(toStep(-0.001, 0.1), 0)).toBe(true);
    expect(toStep(1234, 100)).toBe(1200);
    expect(toStep(0.1, NaN)).toBe(0.1);
  });

  it("follow what a pixel is, and what ctrl and shift ask for", () => {
    expect(stepOf("move", 0.0016, COARSE)).toBe(0.001);
    expect(stepOf("move", 0.0016, { fine: true, snap: false })).toBeCloseTo(0.0001, 12);
    expect(stepOf("move", 0.0016, { fine: false, snap: true })).toBe(0.02);
    expect(stepOf("turn", 1, { fine: false, snap: true })).toBe(5);
    expect(stepOf("scale", 1, { fine: false, snap: true })).toBe(0.1);
  });

  it("touch only the axes that are let go", () => {
    expect(rounded({ kind: "move", by: [0.12345, 0.6789, 0] }, { kind: "arrow", axis: 1 }, 0.01)).toEqual({ kind: "move", by: [0.12345, 0.68, 0] });
  });
});

describe("a gesture", () => {
  it("goes ten times as slow with shift, from where it is", () => {
    const gesture = gestureOn(ALONG_X, { kind: "arrow", axis: 2 }, ORIGIN);
    const [x, y] = at(ALONG_X, ORIGIN);
    gesture.moveTo(ALONG_X, [x, y - 50], COARSE);
    const far = gesture.amount.kind === "move" ? gesture.amount.by[2] : NaN;
    gesture.moveTo(ALONG_X, [x, y - 100], { fine: true, snap: false });
    expect(gesture.amount.kind === "move" ? gesture.amount.by[2] : NaN).toBeCloseTo(far * 1.1, 2);
    expect(gesture.hasMoved).toBe(true);
  });

  it("snaps with ctrl to round steps, a ring to 5 degrees", () => {
    const away: Vector = [0, 0.5, 0];
    const gesture = gestureOn(OBLIQUE, { kind: "ring", axis: 2 }, away);
    gesture.moveTo(OBLIQUE, at(OBLIQUE, transformed(turn([0, 0, 1], 21.4), away)), { fine: false, snap: true });
    expect(gesture.amount).toEqual({ kind: "turn", degrees: 20 });
    expect(gesture.edit()).toEqual({ key: "rotate", values: { axis: [0, 0, 1], degrees: 20 } });
  });

  it("takes a typed value exactly, and the pointer says nothing any more", () => {
    const gesture = gestureOn(OBLIQUE, { kind: "box", axis: 2 }, [0, 0, 0.4]);
    gesture.moveTo(OBLIQUE, at(OBLIQUE, [0, 0, 0.31]), COARSE);
    expect(gesture.type("0,5")).toBe(true);
    gesture.moveTo(OBLIQUE, at(OBLIQUE, [0, 0, 0.9]), COARSE);
    expect(gesture.edit()).toEqual({ key: "scale_direction", values: { factors: [1, 1, 0.5] } });
    expect(gesture.type("half")).toBe(false);
    expect(gesture.amount).toEqual({ kind: "scale", factor: 0.5 });
  });

  it("is locked to another axis on the way, and keeps what was typed", () => {
    const gesture = gestureOn(OBLIQUE, { kind: "free" }, ORIGIN);
    gesture.moveTo(OBLIQUE, at(OBLIQUE, [0.2, 0.3, 0.4]), COARSE);
    gesture.lockTo(OBLIQUE, 2, false);
    const by = gesture.amount.kind === "move" ? gesture.amount.by : ORIGIN;
    expect([by[0], by[1]]).toEqual([0, 0]);
    expect(by[2]).not.toBe(0);
    gesture.lockTo(OBLIQUE, 2, true);
    expect(gesture.lock).toEqual({ kind: "plane", axis: 2 });
    gesture.lockTo(OBLIQUE, 1, false);
    gesture.type("12.5");
    gesture.lockTo(OBLIQUE, 0, false);
    expect(gesture.edit()).toEqual({ key: "translate", values: { by: [12.5, 0, 0] } });
    expect(amountText(gesture.amount, gesture.lock)).toBe("12.5");
  });

  it("reads one number as a length, several along the axes", () => {
    const none = { kind: "move" as const, by: ORIGIN };
    expect(typedAmount(none, { kind: "move", by: [0.3, 0.4, 0] }, { kind: "plane", axis: 2 }, "10")).toEqual({ kind: "move", by: [6, 8, 0] });
    expect(typedAmount(none, none, { kind: "plane", axis: 2 }, "1 2")).toEqual({ kind: "move", by: [1, 2, 0] });
    expect(typedAmount(none, none, { kind: "free" }, "1 2 3")).toEqual({ kind: "move", by: [1, 2, 3] });
    expect(typedAmount(none, none, { kind: "plane", axis: 2 }, "1 2 3")).toBeNull();
    expect(typedAmount(none, none, { kind: "arrow", axis: 0 }, "")).toBeNull();
  });
});

describe("a handle's edit", () => {
  const standing = (key: string, body: Base["bodies"][string]): Base => ({ key, bodies: { [key]: body }, isNeutral: false });

  it("is added to where it is of the same kind: what is typed is what the form then says", () => {
    const moved = new ShapeComposer(standing("translate", { by: [1, 2, 3] }), ORIGIN);
    expect(moved.pivot).toEqual([1, 2, 3]);
    expect(moved.start({ kind: "arrow", axis: 2 })).toEqual({ kind: "move", by: [1, 2, 3] });
    const turned = new ShapeComposer(standing("rotate", { axis: [0, 0, -2], degrees: 10 }), ORIGIN);
    expect(turned.start({ kind: "ring", axis: 2 })).toEqual({ kind: "turn", degrees: -10 });
    const scaled = new ShapeComposer(standing("scale_direction", { factors: [1, 2, 0.5] }), ORIGIN);
    expect(scaled.start({ kind: "box", axis: 2 })).toEqual({ kind: "scale", factor: 0.5 });
    expect(scaled.compose({ kind: "box", axis: 0 }, { kind: "scale", factor: 3 })).toEqual({ key: "scale_direction", values: { factors: [3, 2, 0.5] } });
  });

  it("is one matrix where gestures of several kinds follow each other, about where the handle then is", () => {
    const center: Vector = [1, 1, 1];
    const composer = new ShapeComposer(standing("translate", { by: [0, 0, 2] }), center);
    expect(composer.pivot).toEqual([1, 1, 3]);
    const { key, values } = composer.compose({ kind: "ring", axis: 0 }, { kind: "turn", degrees: 90 });
    expect(key).toBe("affine");
    // A point of the handle goes up and then turns about the middle that has gone up.
    const point: Vector = [1, 2, 1];
    const matrix = values.matrix as [Vector, Vector, Vector];
    const image = add(add(transformed(matrix, [point[0] - center[0], point[1] - center[1], point[2] - center[2]]), center), values.translation as Vector);
    expect(image).toEqual([1, 1, 4]);
    const again = new ShapeComposer(standing("affine", values), center);
    expect(again.compose({ kind: "arrow", axis: 1 }, { kind: "move", by: [0, 5, 2] })).toEqual({ key: "affine", values: { matrix, translation: [0, 5, 2], center: null } });
  });

  it("turns about the centre that the form says", () => {
    const base = standing("rotate", { axis: [0, 0, 1], degrees: 90, center: [2, 0, 0] });
    const composer = new ShapeComposer(base, ORIGIN);
    expect(composer.pivot).toEqual([2, 0, 0]);
    const moved = composer.compose({ kind: "arrow", axis: 0 }, { kind: "move", by: [2, -2, 0] });
    expect(moved.key).toBe("affine");
    expect(composer.start({ kind: "arrow", axis: 0 })).toEqual({ kind: "move", by: [2, -2, 0] });
  });

  it("forgets a centre that was typed for an edit before", () => {
    const base: Base = { key: "translate", bodies: { rotate: { center: [5, 5, 5] } }, isNeutral: true };
    expect(new ShapeComposer(base, ORIGIN).compose({ kind: "ring", axis: 1 }, { kind: "turn", degrees: 5 }).values).toEqual({ axis: [0, 1, 0], degrees: 5, center: null });
  });
});
