// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { Handles } from "../../src/handles/handles";
import { Overlay } from "../../src/handles/overlay";
import type { Place } from "../../src/handles/projection";
import { ShapeTarget } from "../../src/handles/shape-target";
import type { Bones } from "../../src/picture/skeleton";
import { segmentsOf } from "../../src/picture/skeleton";
import { bodyOf, chosen } from "../../src/store/draft";
import { Selection } from "../../src/store/selection";
import { page } from "../page";
import { openDocument } from "../panels/document";
import { OBLIQUE } from "./cameras";

/** A straight branch of eight nodes along x, of which the ends are pinned. */
function branch(): Bones {
  const curves = [Uint32Array.from({ length: 8 }, (_, i) => i)];
  const points = [...curves[0]!].flatMap((i) => [(i - 3.5) / 4, 0, 0]);
  return { reference: Float64Array.from(points), now: Float32Array.from(points), preview: null, curves, features: ["wall"], ...segmentsOf(curves, 8) };
}

/** A triangle of the feature "throat", whose box has its middle in the origin, and one of "wall". */
const SURFACE = {
  topology: { kind: "topology" as const, view: "walls", topology: "t", points: 6, triangles: Uint32Array.of(0, 1, 2, 3, 4, 5), triangleFeatures: Uint32Array.of(3, 2), lines: new Uint32Array(0) },
  coordinates: Float32Array.of(-0.5, -0.5, -0.5, 0.5, 0.5, -0.5, 0, 0, 0.5, 1, 0, 0, 2, 0, 0, 1, 1, 0),
};

describe("shaping by hand", () => {
  let made: ReturnType<typeof page>;
  let scene: HTMLElement;
  let stage: HTMLElement;
  let handles: Handles;
  let bones: Bones | null;
  let under: { feature: string; point: Vector } | null;
  /** What the camera has seen, by pointer. */
  let camera: string[];

  const point = (kind: string, [x, y]: Place, more: PointerEventInit = {}): void =>
    void scene.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, button: 0, buttons: kind === "pointerup" ? 0 : 1, pointerId: 1, isPrimary: true, pointerType: "mouse", clientX: x, clientY: y, ...more }));
  const finger = (kind: string, at: Place, pointerId: number): void => point(kind, at, { pointerType: "touch", pointerId, isPrimary: pointerId === 1 });
  const drag = (from: Place, by: Place, more: PointerEventInit = {}): void => {
    point("pointerdown", from, more);
    point("pointermove", [from[0] + by[0], from[1] + by[1]], more);
    point("pointerup", [from[0] + by[0], from[1] + by[1]], more);
  };
  const key = (name: string, target: EventTarget = scene): boolean => target.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true }));
  const moved = (): unknown => bodyOf(made.store.state.draft).by;
  const box = (): HTMLInputElement => document.querySelector<HTMLInputElement>(".gizmo-value input")!;
  const meant = (): number => document.querySelectorAll(".nodes circle.meant").length;
  const several = (): HTMLButtonElement => [...document.querySelectorAll<HTMLButtonElement>(".face-tools button")].find(({ textContent }) => textContent === "Several")!;
  /** Where the pointer is to go so that a point of the model goes with it. */
  const way = (from: Vector, to: Vector): Place => {
    const [a, b] = [OBLIQUE.toPicture(from)!, OBLIQUE.toPicture(to)!];
    return [b[0] - a[0], b[1] - a[1]];
  };

  beforeEach(() => {
    openDocument();
    made = page();
    [stage, scene] = [document.getElementById("stage")!, document.getElementById("scene")!];
    stage.setPointerCapture = () => undefined;
    [bones, under, camera] = [null, null, []];
    const picture = { projection: () => OBLIQUE, pick: () => under, get shownBones() { return bones; } };
    const shape = new ShapeTarget(() => made.store.state, () => [SURFACE], { isActive: false, hasRegion: false, bounds: () => null, pick: () => null });
    handles = new Handles(stage, scene, picture, made.store, new Selection(made.store), shape, new Overlay(stage, null), document.getElementById("tools")!);
    for (const kind of ["pointerdown", "pointermove", "pointerup"]) scene.addEventListener(kind, (event) => camera.push(`${kind.slice(7)} ${(event as PointerEvent).pointerId}`));
    // What listens to the window stays there.
    return () => {
      for (const pointerId of [1, 2]) point("pointercancel", [0, 0], { pointerId });
      key("Escape");
    };
  });

  describe("on the handle", () => {
    beforeEach(() => {
      made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
      handles.drawn();
    });
    const arrow = (): Place => handles.places()["arrow z"]!;

    it("composes one edit of a drag, along the axis of the part that is dragged, and the camera sees nothing of it", () => {
      drag(arrow(), way([0, 0, 0], [0, 0, 0.4]));
      const [x, y, z] = moved() as Vector;
      expect([x, y]).toEqual([0, 0]);
      expect(z).toBeCloseTo(0.4, 1);
      expect([camera, made.store.state.draft.past.length, chosen(made.store.state, "handle")]).toEqual([[], 1, ["throat"]]);
      // The number stays, so that another can be typed.
      expect(Number(box().value)).toBe(z);
      box().focus();
      box().value = "0.25";
      box().dispatchEvent(new Event("input"));
      expect(moved()).toEqual([0, 0, 0.25]);
      key("Enter", box());
      expect([box().closest("label")!.hidden, moved()]).toEqual([true, [0, 0, 0.25]]);
    });

    it("puts back with Escape what was there before the drag, and follows the pointer no more until it is pressed anew", () => {
      made.store.dispatch({ type: "composed", key: "translate", values: { by: [1, 0, 0] }, step: "earlier" });
      const from = arrow();
      point("pointerdown", from);
      point("pointermove", [from[0], from[1] - 60]);
      expect((moved() as Vector)[2]).toBeGreaterThan(0);
      key("Escape");
      expect(moved()).toEqual([1, 0, 0]);
      point("pointermove", [from[0], from[1] - 90]);
      point("pointerup", [from[0], from[1] - 90]);
      expect([moved(), camera]).toEqual([[1, 0, 0], []]);
    });

    it("locks a drag to another axis, and gives the amount up where the pointer is cancelled", () => {
      const from = arrow();
      point("pointerdown", from);
      point("pointermove", [from[0] + 40, from[1] - 40]);
      key("x");
      expect((moved() as Vector).map((part) => part !== 0)).toEqual([true, false, false]);
      point("pointercancel", from);
      expect(made.store.state.draft.past).toEqual([]);
      expect(moved()).toBeUndefined();
    });

    it("takes a click that drags nothing for one on the feature, and leaves what is no handle to the camera", () => {
      under = { feature: "throat", point: [0, 0, 0] };
      const beside: Place = [20, 20];
      point("pointerdown", beside);
      point("pointermove", [22, 21]);
      point("pointerup", [22, 21]);
      expect([chosen(made.store.state, "handle"), moved(), camera]).toEqual([[], undefined, []]);
      under = { feature: "wall", point: [0, 0, 0] };
      drag(beside, [50, 0]);
      expect([moved(), camera]).toEqual([undefined, ["down 1", "move 1", "up 1"]]);
      // With ctrl whatever is under the pointer is moved.
      drag(beside, [50, 0], { ctrlKey: true });
      expect([chosen(made.store.state, "handle"), camera.length]).toEqual([["wall"], 3]);
      expect(moved()).not.toBeUndefined();
    });

    it("is done by the keyboard alone: what, along which axis, and how far", () => {
      key("g");
      key("y");
      key("3");
      expect(document.activeElement).toBe(box());
      box().value = "3";
      box().dispatchEvent(new Event("input"));
      key("Enter", box());
      expect([moved(), document.activeElement]).toEqual([[0, 3, 0], scene]);
    });

    it("ends with Ctrl+Enter, also in the number, and leaves the key to Apply", () => {
      for (const target of [(): EventTarget => scene, box]) {
        drag(arrow(), way([0, 0, 0], [0, 0, 0.4]));
        const by = moved();
        if (target === box) box().focus();
        const heard: string[] = [];
        const hearing = new AbortController();
        window.addEventListener("keydown", ({ key: name }) => heard.push(name), { signal: hearing.signal });
        const isLeft = target().dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", ctrlKey: true, bubbles: true, cancelable: true }));
        hearing.abort();
        expect([isLeft, heard, box().closest("label")!.hidden, moved()]).toEqual([true, ["Enter"], true, by]);
      }
    });

    it("leaves keys to what has the focus elsewhere while a number can be typed, and to a sheet that lies over the page", () => {
      key("g");
      const plot = document.createElement("div");
      plot.setAttribute("role", "slider");
      document.body.append(plot);
      for (const name of ["0", "-", "x", "Escape"]) expect(key(name, plot), name).toBe(true);
      const sheet = document.getElementById("keys")!;
      sheet.setAttribute("open", "");
      expect([key("Escape", document.body), box().closest("label")!.hidden]).toEqual([true, false]);
      sheet.removeAttribute("open");
      expect([key("Escape"), box().closest("label")!.hidden]).toEqual([false, true]);
    });

    it("leaves both fingers to the camera where a second one comes before the first has dragged anything", () => {
      finger("pointerdown", arrow(), 1);
      expect(camera).toEqual([]);
      finger("pointerdown", [300, 300], 2);
      expect(camera).toEqual(["down 1", "down 2"]);
      finger("pointermove", [arrow()[0], arrow()[1] - 50], 1);
      finger("pointerup", [320, 300], 2);
      finger("pointerup", arrow(), 1);
      expect([camera.slice(2), moved(), made.store.state.draft.past]).toEqual([["move 1", "up 2", "up 1"], undefined, []]);
      // The next finger grips again.
      finger("pointerdown", arrow(), 1);
      expect(camera).toHaveLength(5);
    });

    it("leaves a finger to the camera that comes beside one that is there already", () => {
      finger("pointerdown", [10, 10], 1);
      finger("pointerdown", arrow(), 2);
      expect(camera).toEqual(["down 1", "down 2"]);
    });

    it("goes on with a drag whatever other fingers do", () => {
      const from = arrow();
      finger("pointerdown", from, 1);
      finger("pointermove", [from[0], from[1] - 30], 1);
      finger("pointerdown", [300, 300], 2);
      finger("pointermove", [from[0], from[1] - 60], 1);
      const far = (moved() as Vector)[2];
      finger("pointermove", [300, 200], 2);
      finger("pointerup", [300, 200], 2);
      expect([camera, (moved() as Vector)[2]]).toEqual([[], far]);
    });
  });

  describe("on nodes of the skeleton", () => {
    beforeEach(() => {
      bones = branch();
      handles.drawn();
    });
    const nodes = (): Place[] => handles.nodePlaces();
    const drags = (): unknown[] => bodyOf(made.store.state.draft).moves as unknown[];

    it("drags the one that is pressed, and the chosen ones together with Several, which a finger needs no shift for", () => {
      drag(nodes()[1]!, [0, -30], { pointerType: "touch" });
      expect([drags().length, meant()]).toEqual([1, 1]);
      made.store.dispatch({ type: "cleared" });
      expect(several().getAttribute("aria-pressed")).toBe("false");
      several().click();
      expect(several().getAttribute("aria-pressed")).toBe("true");
      for (const at of [1, 2]) {
        finger("pointerdown", nodes()[at]!, 1);
        finger("pointerup", nodes()[at]!, 1);
      }
      expect(meant()).toBe(2);
      drag(nodes()[4]!, [0, -30], { pointerType: "touch" });
      expect([drags().length, meant()]).toEqual([3, 3]);
      several().click();
      finger("pointerdown", nodes()[0]!, 1);
      finger("pointerup", nodes()[0]!, 1);
      expect(meant()).toBe(1);
    });

    it("are larger where the pointer is over one that can be dragged, and pinned ones small", () => {
      const radii = (): number[] => [...document.querySelectorAll(".nodes circle")].map((circle) => Number(circle.getAttribute("r")));
      const free = radii();
      expect([new Set(free), free.filter((radius) => radius === 3).length, free.length - 2]).toEqual([new Set([3, 5]), 2, nodes().length]);
      const over = (place: Place): number[] => {
        point("pointermove", place, { buttons: 0 });
        return radii();
      };
      const [at] = free.flatMap((radius, i) => (radius === 5 ? [i] : []));
      expect(over(nodes()[0]!)).toEqual(free.map((radius, i) => (i === at ? 8 : radius)));
      expect(over([10, 10])).toEqual(free);
    });

    it("adds nodes with shift, and lets them go with Escape", () => {
      for (const at of [1, 3]) {
        point("pointerdown", nodes()[at]!, { shiftKey: true });
        point("pointerup", nodes()[at]!, { shiftKey: true });
      }
      expect(meant()).toBe(2);
      // It is for nothing else then, and the next one is.
      expect([key("Escape"), meant(), key("Escape")]).toEqual([false, 0, true]);
    });

    it("means the nodes of before where a second finger says that the camera was meant", () => {
      point("pointerdown", nodes()[1]!);
      point("pointerup", nodes()[1]!);
      several().click();
      finger("pointerdown", nodes()[3]!, 1);
      expect(meant()).toBe(2);
      finger("pointerdown", [10, 10], 2);
      expect([meant(), camera]).toEqual([1, ["down 1", "down 2"]]);
    });
  });
});
