// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { History, seriesKey } from "../../src/history/series";
import { Marks } from "../../src/picture/marks";
import { Pins } from "../../src/picture/pins";
import type { ProbeReading } from "../../src/picture/probe";
import { Ruler, measure } from "../../src/picture/ruler";
import { Kept } from "../../src/store/kept";
import { looksOf } from "../../src/store/looks";

let root: SVGElement;
let marks: Marks;
beforeEach(() => {
  root = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  marks = new Marks(root, ([x, y]) => [100 * x, 100 * y]);
});

describe("marks over the picture", () => {
  it("measures between two clicks, and begins anew with a third", () => {
    const ruler = new Ruler(marks);
    ruler.toggle();
    ruler.take([0, 0, 0]);
    ruler.take([3, 4, 0]);
    expect(root.querySelector("text")?.textContent).toBe("5  (3, 4, 0)");
    expect(root.querySelectorAll("circle").length).toBe(2);
    ruler.take([1, 1, 1]);
    expect(root.querySelectorAll("circle").length).toBe(1);
    ruler.toggle();
    expect(root.childNodes.length).toBe(0);
    expect(measure([[1, 1, 1]])).toBe("");
  });

  it("are made once for each picture, though their owners tell of them with each", () => {
    const place = vi.fn(([x, y]: readonly number[]): [number, number] => [x!, y!]);
    const counted = new Marks(root, place);
    const told = (): void => {
      counted.set("pins", [{ points: [[1, 2, 3]], label: "probe 1", kind: "probe" }]);
      counted.set("worst", []);
    };
    told();
    place.mockClear();
    told();
    expect(place).not.toHaveBeenCalled();
    counted.draw();
    expect(place).toHaveBeenCalledTimes(1);
  });

  it("outline a cell over everything, beside the ring that tells where a small one is", () => {
    marks.set("worst", [{ points: [[1, 1, 0]], label: "", kind: "cell", edges: [[[0, 0, 0], [2, 0, 0]], [[2, 0, 0], [2, 3, 0]]] }]);
    expect([...root.querySelectorAll("path")].map((path) => [path.getAttribute("class"), path.getAttribute("d")])).toEqual([["ground", "M0,0L200,0M200,0L200,300"], ["cell", "M0,0L200,0M200,0L200,300"]]);
    expect(root.querySelectorAll("circle.cell").length).toBe(1);
    marks.set("worst", []);
    expect(root.childNodes.length).toBe(0);
  });

  it("plots pinned places, each field by itself, and forgets them", () => {
    const history = new History();
    const asked: string[] = [];
    let reading: ProbeReading | null = { point: [1, 2, 3], feature: 0, field: "p", component: -1, value: 5, cycle: 1, time: 0.1 };
    const pins = new Pins(history, marks, { read: () => reading, near: () => null, topologyOf: () => "1" }, ({ field }) => ({ name: field ?? "", unit: "Pa" }), (key) => asked.push(key), () => undefined);
    expect(pins.update()).toBe(false);
    pins.add({ view: "v", topology: "1", triangle: 0, weights: [1, 0, 0] });
    reading = { ...reading, value: 6, cycle: 2 };
    pins.update();
    reading = { ...reading, field: "q" };
    pins.update();
    const [p, q] = [seriesKey("probe 1, p", "p"), seriesKey("probe 1, q", "q")];
    expect(asked).toEqual([p, q]);
    expect([history.at(p, 1), history.at(p, 9), history.at(q, 9)]).toEqual([5, 6, 6]);
    expect(root.querySelector("text")?.textContent).toBe("probe 1");
    reading = null;
    expect(pins.update()).toBe(false);
    pins.clear();
    expect(history.series).toEqual([]);
    expect(root.childNodes.length).toBe(0);
  });
});

describe("what the page keeps over a reload", () => {
  /** A storage, in which a text stands under each key at first. */
  const storage = (text: string | null) => {
    const kept = new Map<string, string>();
    return { getItem: (key: string) => kept.get(key) ?? text, setItem: (key: string, value: string) => { kept.set(key, value); } };
  };
  it("is of one run of a relay where it is about its views, and of all where it is about the person", () => {
    const place = storage(null);
    const page = new Kept(place, "/tombolo/a/");
    page.looks = looksOf([{ name: "cut", kind: "slice" }], [], {});
    page.dock = { open: false, chosen: ["a"] };
    page.theme = "light";
    const other = new Kept(place, "/tombolo/b/");
    expect([other.looks, other.dock, other.theme]).toEqual([{}, { open: true, chosen: null }, "light"]);
    other.dock = { open: true, chosen: [] };
    expect(new Kept(place, "/tombolo/a/").dock).toEqual(page.dock);
  });

  it("comes back, and rubbish counts as nothing", () => {
    const place = storage(null);
    const looks = looksOf([{ name: "cut", kind: "slice" }], [{ name: "velocity", association: "vertex", components: 3 }], {});
    const page = new Kept(place, "/");
    page.looks = { cut: { ...looks.cut!, map: "cividis", opacity: 0.5 } };
    page.dock = { open: false, chosen: ["a"] };
    page.theme = "light";
    const again = new Kept(place, "/");
    expect([again.looks, again.dock, again.theme]).toEqual([page.looks, page.dock, "light"]);
    for (const text of ["", "{", "[]", "7", '{"looks":{"cut":{"visible":1}},"dock":5,"theme":"pink"}', "x".repeat(400_000)]) {
      const other = new Kept(storage(text), "/");
      expect([other.looks, other.dock, other.theme]).toEqual([{}, { open: true, chosen: null }, null]);
    }
    const full = new Kept({ getItem: () => null, setItem: () => { throw new Error("full"); } }, "/");
    full.theme = "dark";
    expect(full.theme).toBe("dark");
  });
});
