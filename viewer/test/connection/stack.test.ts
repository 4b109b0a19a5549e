import { beforeEach, describe, expect, it } from "vitest";
import { Stack } from "../../src/connection/stack";
import type { Json } from "../../src/connection/protocol";

/** A server that answers with two edits at once, when it is let. */
class Server {
  revision = 0;
  edits: Json[] = [];
  asked: string[] = [];
  private waiting: (() => void)[] = [];

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

  beforeEach(() => {
    server = new Server();
    seen = [];
    troubles = [];
    stack = new Stack("https://host/stack", () => seen.push([...stack.edits]), (text) => troubles.push(text), server.ask);
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
