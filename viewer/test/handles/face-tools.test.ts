// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { FaceTools } from "../../src/handles/face-tools";
import type { Place, Projection } from "../../src/handles/projection";
import type { ShownPoints } from "../../src/preview/previewer";
import { bodyOf, chosen } from "../../src/store/draft";
import { page } from "../page";
import { openDocument } from "../panels/document";
import { camera, OBLIQUE } from "./cameras";
import { cube } from "./cube";

const { points, triangles, sides } = cube(6);
const surface = (): ShownPoints => ({ points: points.slice(), triangles, reference: Float64Array.from(points), features: ["inlet", "outlet", "wall", "throat"], triangleFeatures: Uint32Array.from(sides, (side) => (side === 4 ? 2 : 3)) });

describe("choosing faces", () => {
  let made: ReturnType<typeof page>;
  let scene: HTMLElement;
  let tools: FaceTools;
  let projection: Projection;
  /** How many faces are coloured in the picture. */
  let painted: number;
  let tell: (shown: ShownPoints) => void;
  /** What the tools left to the camera and to the handles. */
  let passed: string[];

  const send = (kind: string, [clientX, clientY]: Place, more: PointerEventInit = {}): void =>
    void scene.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, button: 0, buttons: kind === "pointerup" ? 0 : 1, pointerId: 1, clientX, clientY, ...more }));
  const stroke = (path: readonly Place[], more: PointerEventInit = {}): void => {
    send("pointerdown", path[0]!, more);
    for (const place of path.slice(1)) send("pointermove", place, more);
    send("pointerup", path.at(-1)!, more);
  };
  const button = (text: string): HTMLButtonElement => [...document.querySelectorAll<HTMLButtonElement>('[aria-label="Choosing faces"] button')].find(({ textContent }) => textContent === text)!;
  const region = (): Json | undefined => bodyOf(made.store.state.draft).region;
  const faces = (): number[] => (region() as { faces?: number[] } | null)?.faces ?? [];
  const sidesOf = (found: readonly number[]): number[] => [...new Set(found.map((face) => sides[face]!))].sort((a, b) => a - b);
  const escape = (target: EventTarget = scene): boolean => target.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", bubbles: true, cancelable: true }));
  /** The middle of the side +z, and the corners of a square around it. */
  const middle = OBLIQUE.toPicture([0, 0, 1])!;
  const around = (size: number): Place[] => [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => [middle[0] + x! * size, middle[1] + y! * size]);
  const outline = (): string => document.querySelector(".stroke")!.getAttribute("d")!;

  beforeEach(() => {
    openDocument();
    made = page({ surface: { id: "s", vertices: points.length / 3, faces: triangles.length / 3 } });
    scene = document.getElementById("scene")!;
    const stage = document.getElementById("stage")!;
    stage.setPointerCapture = () => undefined;
    [projection, painted, passed] = [OBLIQUE, 0, []];
    const overlay = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    stage.append(overlay);
    const picture = { projection: () => projection, setChosenFaces: (_: Float32Array, corners: Uint32Array) => { painted = corners.length / 3; } };
    tools = new FaceTools(stage, scene, overlay, document.getElementById("faces")!, picture, made.store, (listener) => { tell = listener; listener(surface()); }, () => undefined);
    for (const kind of ["pointerdown", "pointermove", "pointerup"]) scene.addEventListener(kind, () => passed.push(kind));
    // What listens to the window stays there.
    return () => { for (let i = 0; i < 2; i++) escape(); };
  });

  it("by a lasso or a rectangle makes the faces seen in it the region, in place of features that were the handle", () => {
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    stroke(around(30));
    expect([passed.length, region()]).toEqual([5, undefined]);
    document.getElementById("faces")!.click();
    stroke(around(30));
    const lassoed = faces();
    expect([passed.length, sidesOf(lassoed), lassoed.length > 4, painted === lassoed.length, chosen(made.store.state, "handle")]).toEqual([5, [4], true, true, []]);
    expect(document.querySelector('[aria-label="Choosing faces"] output')!.textContent).toBe(`${lassoed.length} faces`);
    button("Rectangle").click();
    const [from, , to] = around(30);
    stroke([from!, to!]);
    expect(faces()).toEqual(lassoed);
    expect(outline()).toBe("");
  });

  it("adds with shift, and takes away with alt, as the list says for those without these keys", () => {
    document.getElementById("faces")!.click();
    button("Rectangle").click();
    const [from, above, to] = around(40);
    stroke([from!, to!]);
    const all = faces();
    stroke([from!, middle], { altKey: true });
    const left = faces();
    expect([left.length > 0, left.length < all.length]).toEqual([true, true]);
    stroke([from!, middle], { shiftKey: true });
    expect(faces()).toEqual(all);
    const mode = document.querySelector<HTMLSelectElement>('[aria-label="what a stroke does"]')!;
    mode.value = "take";
    stroke([above!, middle]);
    expect(faces().length).toBeLessThan(all.length);
    // Each stroke is a step of its own.
    expect(made.store.state.draft.past.length).toBe(4);
  });

  it("by a brush paints while it goes, without gaps however quick the hand is, and through what is hidden where that is wished", () => {
    document.getElementById("faces")!.click();
    button("Brush").click();
    const [from, , to] = around(45);
    send("pointerdown", from!);
    const first = painted;
    expect(first).toBeGreaterThan(0);
    send("pointermove", to!);
    expect([painted > first, region()]).toEqual([true, undefined]);
    const between = tools.pick(middle);
    send("pointerup", to!);
    expect([between, tools.pick(middle) !== null, sidesOf(faces()).every((side) => [0, 3, 4].includes(side))]).toEqual([null, true, true]);
    document.querySelector<HTMLInputElement>('[aria-label="Choosing faces"] input[type="checkbox"]')!.checked = true;
    stroke([middle, middle]);
    expect(sidesOf(faces())).toEqual([2, 4]);
  });

  it("by an angle takes all that is reached without a sharper edge, as far as the field says", () => {
    document.getElementById("faces")!.click();
    button("By angle").click();
    stroke([middle]);
    expect([sidesOf(faces()), faces().length]).toEqual([[4], 72]);
    const size = document.querySelector<HTMLInputElement>('[aria-label="Choosing faces"] input[type="text"]')!;
    size.value = "91";
    size.dispatchEvent(new Event("change"));
    stroke([middle]);
    expect(faces()).toHaveLength(6 * 72);
    size.value = "nonsense";
    size.dispatchEvent(new Event("change"));
    expect(size.value).toBe("91");
    // Beside the surface nothing is meant.
    stroke([[2, 2]]);
    expect(faces()).toHaveLength(6 * 72);
  });

  it("as a box says the place of the faces, and Clear takes the region away", () => {
    document.getElementById("faces")!.click();
    button("By angle").click();
    stroke([middle]);
    button("As box").click();
    expect(region()).toEqual({ box: { lower: [-1, -1, 1], upper: [1, 1, 1] } });
    expect(painted).toBe(72);
    expect(tools.bounds()).toEqual([[-1, -1, 1], [1, 1, 1]]);
    button("Clear").click();
    expect([region(), painted, tools.hasRegion, document.querySelector('[aria-label="Choosing faces"] output')!.textContent]).toEqual([null, 0, false, ""]);
  });

  it("says boxes alone where the run's faces are not these triangles", () => {
    made.greet({ surface: { id: "s", vertices: points.length / 3, faces: triangles.length / 6 } });
    document.getElementById("faces")!.click();
    button("By angle").click();
    stroke([middle]);
    expect(region()).toEqual({ box: { lower: [-1, -1, 1], upper: [1, 1, 1] } });
    expect(document.querySelector('[aria-label="Choosing faces"] output')!.textContent).toBe("72 faces, as a box");
  });

  it("gives a stroke up with Escape, then the tools, and leaves what is typed elsewhere alone", () => {
    document.getElementById("faces")!.click();
    button("Rectangle").click();
    const [from, , to] = around(30);
    stroke([from!, to!]);
    const before = faces();
    button("Brush").click();
    send("pointerdown", [middle[0], middle[1] + 60]);
    expect(painted).not.toBe(before.length);
    escape();
    send("pointerup", middle);
    expect([faces(), painted, tools.isActive]).toEqual([before, before.length, true]);
    const field = document.createElement("input");
    document.body.append(field);
    escape(field);
    expect(tools.isActive).toBe(true);
    escape();
    expect([tools.isActive, document.querySelector<HTMLElement>('[aria-label="Choosing faces"]')!.hidden, faces()]).toEqual([false, true, before]);
  });

  it("gives a stroke up that the browser cancels", () => {
    document.getElementById("faces")!.click();
    send("pointerdown", around(30)[0]!);
    send("pointermove", around(30)[2]!);
    expect(outline()).not.toBe("");
    send("pointercancel", middle);
    expect([outline(), region()]).toEqual(["", undefined]);
  });

  describe("by fingers", () => {
    const finger = (kind: string, at: Place, pointerId: number): void => send(kind, at, { pointerId, pointerType: "touch", isPrimary: pointerId === 1 });
    const [from, above, to] = around(40) as [Place, Place, Place];
    const beside: Place = [from[0] + 9, from[1]];
    let heard: string[];
    beforeEach(() => {
      heard = [];
      for (const kind of ["pointerdown", "pointermove", "pointerup"]) scene.addEventListener(kind, (event) => heard.push(`${kind.slice(7)} ${(event as PointerEvent).pointerId}`));
      document.getElementById("faces")!.click();
      button("Brush").click();
    });

    it("leaves both to the camera where a second comes before the first has gone far, and chooses nothing", () => {
      finger("pointerdown", from, 1);
      finger("pointermove", beside, 1);
      expect([painted > 0, heard]).toEqual([true, []]);
      finger("pointerdown", above, 2);
      finger("pointermove", to, 1);
      finger("pointermove", middle, 2);
      finger("pointerdown", middle, 3);
      finger("pointerup", to, 1);
      finger("pointerup", middle, 2);
      expect(heard).toEqual(["down 1", "down 2", "move 1", "move 2", "down 3", "up 1", "up 2"]);
      expect([painted, outline(), region()]).toEqual([0, "", undefined]);
      // The next one draws again.
      finger("pointerdown", from, 1);
      finger("pointerup", from, 1);
      expect([heard.length, faces().length > 0]).toEqual([7, true]);
    });

    it("keeps a stroke that has gone far from a second", () => {
      finger("pointerdown", from, 1);
      finger("pointermove", to, 1);
      finger("pointerdown", above, 2);
      finger("pointermove", middle, 2);
      finger("pointerup", to, 1);
      expect([heard, faces().length > 0]).toEqual([[], true]);
    });
  });

  it("leave an Escape alone that something else has taken, or that closes a sheet", () => {
    document.getElementById("faces")!.click();
    const isShown = (): boolean => !document.querySelector<HTMLElement>('[aria-label="Choosing faces"]')!.hidden;
    const sheet = document.getElementById("keys")!;
    sheet.setAttribute("open", "");
    escape(document.body);
    sheet.removeAttribute("open");
    // As a row that is dragged does, later than this was made.
    const taken = new AbortController();
    window.addEventListener("keydown", (event) => event.preventDefault(), { capture: true, signal: taken.signal });
    escape();
    taken.abort();
    expect(isShown()).toBe(true);
    expect([escape(), isShown()]).toEqual([false, false]);
  });

  it("looks at all triangles once for each shape and each place to look from, however often one presses", () => {
    made.store.dispatch({ type: "composed", key: "translate", values: { region: { faces: [...sides.keys()].filter((face) => sides[face] === 4) } }, step: "a" });
    const looked = vi.spyOn(OBLIQUE, "toPicture");
    expect(tools.pick(middle)).not.toBeNull();
    expect(looked.mock.calls.length).toBe(points.length / 3);
    for (let i = 0; i < 5; i++) tools.pick(middle);
    expect(looked.mock.calls.length).toBe(points.length / 3);
    // Seen from below the side is hidden.
    projection = camera([6, -7, -4], [0.2, 0.1, 0], [0, 0, 1]);
    expect(tools.pick(projection.toPicture([0, 0, -1])!)).toBeNull();
    projection = OBLIQUE;
    looked.mockClear();
    const moved = surface();
    for (let i = 0; i < moved.points.length; i += 3) moved.points[i]! += 20;
    tell(moved);
    expect(tools.pick(middle)).toBeNull();
    expect(looked.mock.calls.length).toBe(points.length / 3);
    looked.mockRestore();
  });
});
