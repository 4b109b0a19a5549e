import { describe, expect, it } from "vitest";
import { Store, derived, sameJson } from "../../src/store/store";

type Action = { add: number } | { name: string };
const make = (failed?: (error: unknown) => void) => new Store({ count: 0, name: "" }, (state, action: Action) => ("add" in action
  ? action.add === 0 ? state : { ...state, count: state.count + action.add } : { ...state, name: action.name }), failed);

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

  it("goes on where a watcher fails: the others are called, and what they ask for is done", () => {
    const failures: unknown[] = [];
    const store = make((error) => failures.push(error));
    const seen: number[] = [];
    store.watch((state) => state.count, (count) => { if (count === 1) throw new Error("a defect"); });
    store.watch((state) => state.count, (count) => {
      seen.push(count);
      if (count === 1) store.dispatch({ add: 4 });
    });
    store.dispatch({ add: 1 });
    expect([seen, store.state.count]).toEqual([[0, 1, 5], 5]);
    expect(failures).toEqual([new Error("a defect")]);
  });

  it("is as it was after an action that cannot be taken, and takes the next", () => {
    const failures: unknown[] = [];
    const store = new Store(0, (count, by: number) => {
      if (by < 0) throw new Error("a defect");
      return count + by;
    }, (error) => failures.push(error));
    for (const by of [1, -1, 2]) store.dispatch(by);
    expect([store.state, failures.length]).toEqual([3, 1]);
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

it("writes no text to see that lists have the same parts", () => {
  const part = { toJSON: () => { throw new Error("it was written"); } };
  expect(sameJson([1, [part, NaN], undefined], [1, [part, NaN], undefined])).toBe(true);
  expect([sameJson([{ a: 1 }], [{ a: 1 }]), sameJson([{ a: 1 }], [{ a: 2 }]), sameJson([1], [1, 1]), sameJson([], {})]).toEqual([true, false, false, false]);
});
