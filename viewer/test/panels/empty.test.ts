// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchEmpty } from "../../src/panels/empty";
import { page } from "../page";
import { openDocument } from "./document";

describe("what stands in place of the picture", () => {
  let made: ReturnType<typeof page>;
  const said = (): string | null => (document.getElementById("empty")!.hidden ? null : document.getElementById("empty-title")!.textContent);
  beforeEach(() => {
    openDocument();
    made = page();
    watchEmpty(made.store, null);
  });

  it("says what is waited for, until there is a picture", () => {
    const { store, greet } = made;
    expect(said()).toBe("Nothing is streamed");
    greet({ views: [{ name: "cut", kind: "slice" }] });
    expect(said()).toBe("Connected");
    store.dispatch({ type: "connection", state: "refused", explanation: "" });
    expect(said()).toBe("This link does not open the simulation");
    store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    expect(said()).toBe("Waiting for the simulation");
    store.dispatch({ type: "end", end: { how: "finished", cycle: 3, time: 1 } });
    expect(said()).toBe("The run has ended");
    store.dispatch({ type: "frame", view: "cut", cycle: 1 });
    expect(said()).toBeNull();
  });

  it("says that the run has no view of the name that is asked for, and which one was meant", () => {
    const views = (...names: string[]) => ({ views: names.map((name) => ({ name, kind: "slice" as const })) });
    const text = (): string | null => document.getElementById("empty-text")!.textContent;
    openDocument();
    const { store, greet } = page();
    watchEmpty(store, "midplan");
    expect(said()).toBe("Nothing is streamed");
    greet(views("walls", "midplane"));
    expect([said(), text()]).toEqual(["The run has no view “midplan”", "Did you mean “midplane”?"]);
    greet(views("walls", "outlet"));
    expect(text()).toBe("Its views are walls, outlet.");
    greet(views(...Array.from({ length: 14 }, (_, i) => `v${i}`)));
    expect(text()).toMatch(/v6, v7 and 6 more\.$/);
    // A frame of another view is no picture here.
    store.dispatch({ type: "frame", view: "v1", cycle: 1 });
    expect(said()).toBe("The run has no view “midplan”");
    greet(views("midplan"));
    expect(said()).toBeNull();
  });

  it("says that the browser has taken the picture away, and nothing once it is there again", () => {
    made.store.dispatch({ type: "frame", view: "cut", cycle: 1 });
    made.store.dispatch({ type: "picture lost", isLost: true });
    expect(said()).toBe("The picture is gone");
    made.store.dispatch({ type: "picture lost", isLost: false });
    expect(said()).toBeNull();
  });
});
