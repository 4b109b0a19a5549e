import { beforeEach, describe, expect, it } from "vitest";
import { Stack } from "../../src/connection/stack";
import type { Json } from "../../src/connection/protocol";

/** A server that answers with two edits at once, when it is let. */
class Server {
  revision = 0;
  edits: Json[] = [];
  asked: string[] = [];
  private readonly waiting: (() => void)[] = [];

  ask = (address: string) => {
    this.asked.push(address);
    const from = Number(/from=(\d+)/.exec(address)![1]);
    return new Promise<{ revision: number; count: number; edits: Json[] }>((resolve) => {
      this.waiting.push(() => resolve({ revision: this.revision, count: this.edits.length, edits: this.edits.slice(from, from + 2) }));
    });
  };

  async answer(): Promise<void> {
    this.waiting.splice(0).forEach((answer) => answer());
    for (let turn = 0; turn < 5; turn++) await Promise.resolve();
  }

  set(...edits: Json[]): { revision: number; edits: number } {
    this.edits = edits;
    this.revision++;
    return { revision: this.revision, edits: edits.length };
  }
}

describe("the stack of edits", () => {
  let server: Server;
  let stack: Stack;
  let seen: Json[][];
  let troubles: string[];
  let awaited: number;
  let timers: { action: () => void; delay: number }[];

  beforeEach(() => {
    server = new Server();
    seen = [];
    troubles = [];
    awaited = 0;
    timers = [];
    const events = { awaited: () => awaited++, changed: () => seen.push([...stack.edits]), trouble: (text: string) => troubles.push(text) };
    stack = new Stack("https://host/stack", events, (address) => server.ask(address), {
      setTimer: (action, delay) => timers.push({ action, delay }), clearTimer: (timer) => { timers[timer - 1]!.action = () => undefined; }, random: () => 0.5,
    });
  });

  it("is fetched part by part, and later only what has changed", async () => {
    stack.begin(server.set("a", "b", "c"));
    await server.answer();
    expect(seen).toEqual([]);
    await server.answer();
    expect(seen).toEqual([["a", "b", "c"]]);
    stack.change({ ...server.set("a", "b", "d"), kept: 2 });
    await server.answer();
    expect(seen.at(-1)).toEqual(["a", "b", "d"]);
    expect(server.asked.map((address) => address.split("?")[1])).toEqual(["from=0&revision=1", "from=2&revision=1", "from=2&revision=2"]);
    stack.change({ ...server.set("a"), kept: 1 });
    expect(seen.at(-1)).toEqual(["a"]);
    expect(server.asked).toHaveLength(3);
  });

  it("is never a mixture of two", async () => {
    stack.begin(server.set("a", "b", "c"));
    await server.answer();
    // Its second part is answered from a stack of which the viewer hears only now.
    const told = server.set("x");
    await server.answer();
    expect(seen).toEqual([]);
    stack.change({ ...told, kept: 0 });
    await server.answer();
    expect(seen).toEqual([["x"]]);
    // An answer of before comes late.
    stack.change({ ...server.set("y", "z"), kept: 0 });
    const before = server.revision;
    server.revision = before - 1;
    await server.answer();
    server.revision = before;
    await server.answer();
    expect(seen.at(-1)).toEqual(["y", "z"]);
  });

  it("is not mixed of an answer that was asked for before the stack changed", async () => {
    stack.begin(server.set("a", "b", "c"));
    await server.answer();
    // The second part was asked for; then all edits are other ones, and the answer is of those already.
    stack.change({ ...server.set("x", "y", "z"), kept: 0 });
    await server.answer();
    for (let part = 0; part < 2; part++) await server.answer();
    expect(seen).toEqual([["x", "y", "z"]]);
  });

  it("is said to be another one until all of its edits are here", async () => {
    expect(stack.isWhole).toBe(true);
    stack.begin(server.set("a"));
    expect([stack.isWhole, awaited]).toEqual([false, 1]);
    await server.answer();
    expect([stack.isWhole, seen]).toEqual([true, [["a"]]]);
    stack.change({ ...server.set("a", "b"), kept: 1 });
    expect([stack.isWhole, awaited]).toEqual([false, 2]);
    await server.answer();
    // Of an undo nothing is to be fetched.
    stack.change({ ...server.set("a"), kept: 1 });
    expect([stack.isWhole, awaited, seen.at(-1)]).toEqual([true, 2, ["a"]]);
    stack.begin({ revision: 9, edits: 4 });
    expect([stack.isWhole, awaited, stack.edits]).toEqual([false, 3, ["a"]]);
  });

  it("is asked for again where an answer failed, waiting longer each time", async () => {
    const { ask } = server;
    let fails = true;
    server.ask = (address) => (fails ? Promise.reject(new Error("the server answers with 503")) : ask(address));
    stack.begin(server.set("a"));
    for (let attempt = 0; attempt < 3; attempt++) {
      await server.answer();
      expect([stack.isWhole, timers.length]).toEqual([false, attempt + 1]);
      if (attempt < 2) timers.at(-1)!.action();
    }
    expect(timers.map(({ delay }) => delay)).toEqual([250, 500, 1000]);
    expect(troubles).toEqual(["The edits of the shape could not be loaded: the server answers with 503."]);
    fails = false;
    timers.at(-1)!.action();
    await server.answer();
    expect([stack.isWhole, seen]).toEqual([true, [["a"]]]);
    // A change that comes first is not waited for, and what was to be repeated is not.
    fails = true;
    stack.change({ ...server.set("a", "b"), kept: 1 });
    await server.answer();
    const waiting = timers.at(-1)!;
    fails = false;
    stack.change({ ...server.set("a", "c"), kept: 1 });
    await server.answer();
    const asked = server.asked.length;
    waiting.action();
    await server.answer();
    expect([seen.at(-1), server.asked.length]).toEqual([["a", "c"], asked]);
  });

  it("of another run takes the place of the last one's, and what is wrong is said", async () => {
    stack.begin(server.set("a"));
    stack.begin({ revision: 0, edits: 1 });
    server.revision = 0;
    server.edits = [];
    await server.answer();
    expect(seen).toEqual([]);
    expect(troubles).toEqual(["The edits of the shape could not be loaded: the server has fewer edits than it says."]);
  });
});
