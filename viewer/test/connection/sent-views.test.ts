import { describe, expect, it } from "vitest";
import { SentViews } from "../../src/connection/sent-views";
import type { Hello, ViewInformation } from "../../src/connection/protocol";
import { page } from "../page";

const VIEWS: ViewInformation[] = [{ name: "surface", kind: "surface" }, { name: "cut", kind: "slice" }, { name: "lines", kind: "streamlines" }];

function setUp(hello: Partial<Hello> = {}, only: string | null = null) {
  const made = page({ views: VIEWS, ...hello });
  const pinned = new Set<string>();
  const views = new SentViews(made.store, () => pinned, only, (message) => made.commands.ask(message));
  const told = (): unknown[] => made.sent.flatMap((message) => ("views" in message ? [message.views] : []));
  const see = (view: string, visible: boolean): void => made.store.dispatch({ type: "look", view, look: { visible } });
  return { ...made, views, pinned, told, see };
}

describe("the views that the run sends", () => {
  it("are all at first, of which nothing is said", () => {
    const { views, told } = setUp();
    expect(told()).toEqual([]);
    expect(views.has("lines")).toBe(true);
  });

  it("are without those that are hidden, until they are shown again", () => {
    const { views, told, see } = setUp();
    see("lines", false);
    expect(told()).toEqual([{ names: ["surface", "cut"] }]);
    expect([views.has("lines"), views.has("cut")]).toEqual([false, true]);
    see("lines", true);
    expect(told()).toEqual([{ names: ["surface", "cut"] }, {}]);
    expect(views.has("lines")).toBe(true);
  });

  it("hold the surface, on which features are found, and the view that panels are about", () => {
    const { store, told, see } = setUp();
    store.dispatch({ type: "view chosen", view: "cut" });
    see("surface", false);
    see("cut", false);
    expect(told()).toEqual([]);
    store.dispatch({ type: "view chosen", view: "surface" });
    expect(told()).toEqual([{ names: ["surface", "lines"] }]);
  });

  it("hold what panels are made of, also where it is not in the picture", () => {
    const { told, see } = setUp({ views: [...VIEWS, { name: "line", kind: "probe" }, { name: "worst cells", kind: "threshold" }] });
    see("line", false);
    see("worst cells", false);
    expect(told()).toEqual([]);
  });

  it("hold those with a pin", () => {
    const { views, pinned, told, see } = setUp();
    pinned.add("lines");
    see("lines", false);
    expect(told()).toEqual([]);
    pinned.clear();
    views.update();
    expect(told()).toEqual([{ names: ["surface", "cut"] }]);
  });

  it("are told anew on a new connection, once the run has said hello there", () => {
    const { store, greet, views, told, see } = setUp();
    see("lines", false);
    store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    store.dispatch({ type: "connection", state: "connected", explanation: "" });
    expect(told()).toHaveLength(1);
    expect(views.has("lines")).toBe(true);
    greet({});
    expect(told()).toEqual([{ names: ["surface", "cut"] }, { names: ["surface", "cut"] }]);
  });

  it("follow the pipelines: a view that is new is sent", () => {
    const { greet, told, see } = setUp();
    see("lines", false);
    greet({ views: [...VIEWS, { name: "worst cells", kind: "threshold" }] });
    expect(told().at(-1)).toEqual({ names: ["surface", "cut", "worst cells"] });
  });

  it("are one alone where the page shows no other", () => {
    expect(setUp({}, "cut").told()).toEqual([{ names: ["cut"] }]);
  });

  it("are not chosen of a recording, nor where their names are more than a message holds", () => {
    const recorded = setUp({ recording: { run: "", seconds: 1, markers: [] } as never });
    recorded.see("lines", false);
    expect(recorded.told()).toEqual([]);
    const many = setUp({ views: [...VIEWS, ...Array.from({ length: 300 }, (_, i) => ({ name: `cut ${i}`, kind: "slice" }))] });
    many.see("lines", false);
    expect(many.told()).toEqual([]);
    const long = setUp({ views: [...VIEWS, ...Array.from({ length: 100 }, (_, i) => ({ name: `${i}${"ü".repeat(90)}`, kind: "slice" }))] });
    long.see("lines", false);
    expect(long.told()).toEqual([]);
  });
});
