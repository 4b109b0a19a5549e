// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import type { Stand } from "../../src/picture/camera";
import { Compare } from "../../src/picture/compare";
import { Earlier } from "../../src/picture/earlier";
import type { Bar, Scene } from "../../src/picture/scene";
import { firstLook } from "../../src/store/looks";
import type { Looks } from "../../src/store/looks";
import { Selection } from "../../src/store/selection";
import { page } from "../page";

/** Stands in for a picture, which needs WebGL: what it was told, and how its camera stands. */
class StandIn {
  layers = new Map<string, { frame: DataFrame }>();
  looks: Looks = {};
  views: string[] = [];
  theme = "";
  frames: DataFrame[] = [];
  camera = { stand: stand(0), fit: () => undefined };
  constructor(_: unknown, __: unknown, ___: unknown, readonly events: { drawn(): void } = { drawn: () => undefined }) { made.push(this); }
  setTheme(theme: string): void { this.theme = theme; }
  setFeatures(): void { /* Nothing is picked here. */ }
  setLooks(views: { name: string }[], looks: Looks): void { [this.views, this.looks] = [views.map(({ name }) => name), looks]; }
  setTopology(): void { /* It goes with the values. */ }
  setData(frame: DataFrame): void {
    this.frames.push(frame);
    this.layers.set(frame.view, { frame });
  }
}
const stand = (x: number): Stand => ({ position: [x, 0, 5], focalPoint: [x, 0, 0], viewUp: [0, 1, 0], parallel: false, parallelScale: 1, viewAngle: 30 });
const made = vi.hoisted(() => [] as StandIn[]);
vi.mock("../../src/picture/scene", () => ({ get Scene() { return StandIn; } }));
vi.mock("../../src/picture/canvas", () => ({ makeCanvas: () => null }));

const VIEWS = ["cut", "late"].map((name) => ({ name, kind: "slice" }));
const content = (view: string, cycle: number) => ({
  name: view, topology: { kind: "topology", view, topology: "1" } as TopologyFrame, frame: { kind: "data", view, topology: "1", cycle } as DataFrame,
});

describe("before and after side by side", () => {
  let root: HTMLElement;
  let button: HTMLButtonElement;
  let main: StandIn;
  let compare: Compare;
  let shown: ReturnType<typeof content>[];
  let told: boolean[];
  const caption = (): string => root.querySelector(".caption")!.textContent;
  const before = (): StandIn => made.at(-1)!;
  const bar = (low: number, high: number): Bar => ({ key: "p", range: [low, high], views: ["cut"] }) as unknown as Bar;

  beforeEach(() => {
    made.length = 0;
    const { store } = page();
    [root, button, shown, told] = [document.createElement("div"), document.createElement("button"), [content("cut", 5)], []];
    root.hidden = true;
    main = new StandIn(null, null, null);
    made.length = 0;
    const looks = Object.fromEntries(VIEWS.map((view) => [view.name, firstLook(view, VIEWS, [])]));
    const earlier = new Earlier(store, () => shown, () => compare.update());
    compare = new Compare(root, button, main as unknown as Scene, earlier, { views: () => VIEWS, looks: () => looks, features: () => [], selection: new Selection(store), trouble: () => undefined, shown: (isShown) => told.push(isShown) });
  });

  it("shows the moment that is kept, or what is there where none is, until it is put away", () => {
    compare.setTheme("light");
    expect(made).toEqual([]);
    button.click();
    expect([root.hidden, button.getAttribute("aria-pressed"), caption(), before().theme]).toEqual([false, "true", "at cycle 5", "light"]);
    // A view that was not there then has nothing to show.
    expect([before().views, before().frames.map(({ cycle }) => cycle)]).toEqual([["cut"], [5]]);
    shown = [content("cut", 9)];
    compare.update();
    expect(before().frames).toHaveLength(1);
    root.querySelector("button")!.click();
    expect([caption(), before().frames.map(({ cycle }) => cycle)]).toEqual(["at cycle 9", [5, 9]]);
    button.click();
    expect([root.hidden, button.getAttribute("aria-pressed")]).toEqual([true, "false"]);
    button.click();
    expect(made).toHaveLength(1);
  });

  it("has the colours of the picture of now, whatever its range is", () => {
    button.click();
    expect(before().looks.cut!.range.kind).not.toBe("fixed");
    compare.setBars([bar(1, 3)]);
    expect(before().looks.cut!.range).toMatchObject({ kind: "fixed", low: 1, high: 3 });
    expect(before().looks.late!.range.kind).not.toBe("fixed");
    compare.setBars([bar(1, 4)]);
    expect(before().looks.cut!.range).toMatchObject({ low: 1, high: 4 });
  });

  it("is fitted into its half where it is switched on, and not where it was so before the page was loaded again", () => {
    vi.stubGlobal("requestAnimationFrame", (then: () => void) => then());
    const fit = vi.spyOn(main.camera, "fit");
    compare.restore();
    compare.restore();
    expect([told, root.hidden, button.getAttribute("aria-pressed"), caption(), fit.mock.calls.length]).toEqual([[true], false, "true", "at cycle 5", 0]);
    for (const times of [1, 2]) {
      button.click();
      expect(fit).toHaveBeenCalledTimes(times);
    }
    expect(told).toEqual([true, false, true]);
    vi.unstubAllGlobals();
  });

  it("is seen from the same place, whichever of the two is turned", () => {
    main.camera.stand = stand(1);
    button.click();
    expect(before().camera.stand).toEqual(stand(1));
    main.camera.stand = stand(2);
    compare.follow();
    expect(before().camera.stand).toEqual(stand(2));
    before().camera.stand = stand(3);
    before().events.drawn();
    expect(main.camera.stand).toEqual(stand(3));
    // Put away it follows nothing, and moves nothing.
    button.click();
    main.camera.stand = stand(4);
    compare.follow();
    expect(before().camera.stand).toEqual(stand(3));
    before().camera.stand = stand(5);
    before().events.drawn();
    expect(main.camera.stand).toEqual(stand(4));
  });
});
