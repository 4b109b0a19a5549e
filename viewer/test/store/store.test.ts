import { describe, expect, it } from "vitest";
import { Store, derived } from "../../src/store/store";

type Action = { add: number } | { name: string };
const make = () => new Store({ count: 0, name: "" }, (state, action: Action) => ("add" in action
  ? action.add === 0 ? state : { ...state, count: state.count + action.add } : { ...state, name: action.name }));

describe("the store", () => {
  it("tells those who watch a part at once, and only when it is another one", () => {
    const store = make();
    const seen: number[] = [];
    const end = store.watch((state) => state.count, (count) => seen.push(count));
    store.dispatch({ name: "a" });
    store.dispatch({ add: 2 });
    store.dispatch({ add: 0 });
    end();
    store.dispatch({ add: 5 });
    expect(seen).toEqual([0, 2]);
    expect(store.state).toEqual({ count: 7, name: "a" });
  });

  it("lets all see a state before the next action, whoever dispatches it", () => {
    const store = make();
    const seen: string[] = [];
    store.watch((state) => state.count, (count) => { if (count === 1) store.dispatch({ add: 1 }); });
    store.watch((state) => state.count, (count) => seen.push(`second saw ${count}`));
    store.dispatch({ add: 1 });
    expect(seen).toEqual(["second saw 0", "second saw 1", "second saw 2"]);
  });

  it("goes on after a watcher that fails", () => {
    const store = make();
    let fails = false;
    store.watch((state) => state.count, () => { if (fails) throw new Error("a defect"); });
    fails = true;
    expect(() => store.dispatch({ add: 1 })).toThrow("a defect");
    fails = false;
    store.dispatch({ add: 1 });
    expect(store.state.count).toBe(2);
  });

  it("computes what is derived only where its parts have changed", () => {
    let computed = 0;
    const double = derived((state: { count: number; name: string }) => [state.count], (state) => {
      computed++;
      return { double: 2 * state.count };
    });
    const first = double({ count: 1, name: "a" });
    expect(double({ count: 1, name: "b" })).toBe(first);
    expect(double({ count: 2, name: "b" })).toEqual({ double: 4 });
    expect(computed).toBe(2);
  });
});
