import { describe, expect, it } from "vitest";
import { Connection, SILENCE, backOff, streamAddress } from "../../src/connection/connection";
import type { ConnectionState, Surroundings } from "../../src/connection/connection";

class FakeSocket {
  binaryType = "";
  readyState = 0;
  sent: string[] = [];
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: string | ArrayBuffer }) => void) | null = null;
  onclose: ((event: { code: number; reason: string }) => void) | null = null;
  send(text: string): void { this.sent.push(text); }
  closedWith: number | undefined | null = null;
  close(code?: number): void { this.closedWith = code; this.end(code ?? 1000); }
  open(): void { this.readyState = 1; this.onopen?.(); }
  end(code: number, reason = ""): void { this.readyState = 3; this.onclose?.({ code, reason }); }
}

function setUp(status: number | null = null) {
  const sockets: FakeSocket[] = [];
  const timers: { action: () => void; delay: number }[] = [];
  /** What runs out when nothing is heard; null where that is not waited for. */
  let silence: (() => void) | null = null;
  const states: [ConnectionState, string][] = [];
  const messages: unknown[] = [];
  const troubles: string[] = [];
  const addresses: string[] = [];
  const surroundings: Surroundings = {
    open: (address) => {
      addresses.push(address);
      const socket = new FakeSocket();
      sockets.push(socket);
      return socket as unknown as WebSocket;
    },
    probe: async () => (status === null ? null : { status, text: "no" }),
    setTimer: (action, delay) => {
      if (delay < SILENCE) return timers.push({ action, delay });
      silence = action;
      return -1;
    },
    clearTimer: (timer) => { if (timer === -1) silence = null; },
    random: () => 0.5,
  };
  const connection = new Connection({ address: "ws://x/ws", probe: "http://x/ws" }, {
    state: (state, explanation) => states.push([state, explanation]),
    message: (message) => messages.push(message), binary: (bytes) => messages.push(bytes.byteLength), trouble: (text) => troubles.push(text),
  }, surroundings);
  connection.start();
  return { connection, addresses, sockets, timers, states, messages, troubles, silence: () => silence };
}
const settle = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 0));

describe("back-off", () => {
  it("doubles, stays bounded and never reaches zero", () => {
    expect([0, 1, 2, 3].map((attempt) => backOff(attempt, 0.5))).toEqual([250, 500, 1000, 2000]);
    expect(backOff(1000, 1)).toBe(10000);
    expect(backOff(0, 0)).toBeGreaterThan(100);
  });
});

describe("the address of the stream", () => {
  it("follows the page, below any path and through TLS", () => {
    expect(streamAddress("http://127.0.0.1:7070/").address).toBe("ws://127.0.0.1:7070/ws");
    expect(streamAddress("https://host/run/7/index.html?view=ab#x")).toEqual({
      address: "wss://host/run/7/ws", probe: "https://host/run/7/ws", surface: "https://host/run/7/surface",
      stack: "https://host/run/7/stack", schema: "https://host/run/7/schema/order", pipelines: "https://host/run/7/pipelines",
      pipelineSchema: "https://host/run/7/schema",
    });
  });
});

describe("a connection", () => {
  it("comes back by itself, waiting longer each time, and starts over after success", async () => {
    const { sockets, timers, states } = setUp();
    sockets[0]!.open();
    for (const delay of [250, 500, 1000]) {
      sockets.at(-1)!.end(1006);
      await settle();
      expect(timers.at(-1)!.delay).toBe(delay);
      timers.at(-1)!.action();
    }
    sockets.at(-1)!.open();
    sockets.at(-1)!.onmessage?.({ data: '{"error":{"message":"hello"}}' });
    expect(states.at(-1)![0]).toBe("connected");
    sockets.at(-1)!.end(1006);
    await settle();
    expect(timers.at(-1)!.delay).toBe(250);
    expect(states.map(([state]) => state)).toEqual(["connected", "reconnecting", "reconnecting", "reconnecting", "connected", "reconnecting"]);
  });

  it("tells who is not let in from a server that is not there", async () => {
    for (const [status, state] of [[401, "refused"], [403, "refused"], [null, "reconnecting"], [426, "reconnecting"], [500, "reconnecting"]] as const) {
      const { sockets, states } = setUp(status);
      sockets[0]!.end(1006);
      await settle();
      expect(states.at(-1)![0], `HTTP ${status}`).toBe(state);
    }
    const { sockets, states } = setUp();
    sockets[0]!.open();
    sockets[0]!.end(1013, "16 viewers watch already");
    await settle();
    expect(states.at(-1)).toEqual(["reconnecting", "The simulation closed the connection: 16 viewers watch already."]);
  });

  it("takes a connection on which nothing comes for lost, and makes another", () => {
    const { addresses, sockets, timers, states, messages, silence } = setUp();
    sockets[0]!.open();
    const first = silence();
    sockets[0]!.onmessage?.({ data: new ArrayBuffer(3) });
    expect(silence()).not.toBe(first);
    silence()!();
    expect(states.at(-1)).toEqual(["reconnecting", "Nothing was heard for 25 seconds."]);
    expect([sockets[0]!.readyState, silence()]).toEqual([3, null]);
    // It comes back: the run keeps the wheel for it.
    expect(sockets[0]!.closedWith).toBe(4000);
    timers[0]!.action();
    expect([addresses.length, timers.length]).toEqual([2, 1]);
    // What was on its way on the old one is not heard.
    sockets[0]!.onmessage?.({ data: new ArrayBuffer(4) });
    expect(messages).toEqual([3]);
    // Nor is an answer waited for that never comes.
    silence()!();
    expect(states.at(-1)![0]).toBe("reconnecting");
    expect(timers).toHaveLength(2);
  });

  it("waits for no sign of life where it has ended", async () => {
    const { connection, sockets, silence } = setUp();
    sockets[0]!.open();
    connection.stop();
    await settle();
    expect(sockets[0]!.closedWith).toBeUndefined();
    expect(silence()).toBeNull();
  });

  it("says who it was when it comes back", async () => {
    const { connection, addresses, sockets, timers } = setUp();
    sockets[0]!.open();
    connection.identity = { client: "c7", back: "b8" };
    sockets[0]!.end(1006);
    await settle();
    timers[0]!.action();
    expect(addresses).toEqual(["ws://x/ws", "ws://x/ws?client=c7&back=b8"]);
  });

  it("leaves its name to a tab that was copied from it, and stays away where it was sent away", async () => {
    const { connection, addresses, sockets, states, timers } = setUp();
    sockets[0]!.open();
    connection.identity = { client: "c7", back: "b8" };
    sockets[0]!.end(4002);
    await settle();
    timers[0]!.action();
    expect(addresses.at(-1)).toBe("ws://x/ws");
    sockets[1]!.open();
    sockets[1]!.end(4001);
    await settle();
    expect(states.at(-1)![0]).toBe("dismissed");
    expect(timers).toHaveLength(1);
    connection.retry();
    expect(addresses).toHaveLength(3);
  });

  it("is one, however often somebody tries again", async () => {
    const { connection, sockets, states, timers } = setUp();
    sockets[0]!.open();
    sockets[0]!.end(4001);
    await settle();
    connection.retry();
    connection.retry();
    expect(sockets.map(({ readyState }) => readyState)).toEqual([3, 3, 0]);
    sockets[2]!.open();
    await settle();
    expect([states.at(-1)![0], timers.length]).toEqual(["connected", 0]);
    // One that fails while another was begun meanwhile has nothing to say.
    sockets[2]!.end(4001);
    connection.retry();
    sockets[3]!.end(1006);
    connection.retry();
    await settle();
    expect([sockets.length, timers.length]).toEqual([5, 0]);
  });

  it("gives an attempt that hangs up when somebody tries again, and no connection that is there", async () => {
    const { connection, sockets, timers, states } = setUp();
    connection.retry();
    expect(sockets.map(({ readyState }) => readyState)).toEqual([3, 0]);
    sockets[1]!.end(1006);
    await settle();
    timers[0]!.action();
    // No answer comes to this one either.
    connection.retry();
    expect(sockets.map(({ readyState }) => readyState)).toEqual([3, 3, 3, 0]);
    // What is given up tells nothing, and is not come back to.
    await settle();
    expect([states.length, timers.length]).toEqual([1, 1]);
    sockets[3]!.open();
    connection.retry();
    expect(sockets).toHaveLength(4);
    // Nor is a run that has ended come back to.
    sockets[3]!.end(1000);
    connection.retry();
    expect([connection.state, sockets.length]).toEqual(["ended", 4]);
  });

  it("says when nothing could be sent, and sends JSON when it could", () => {
    const { connection, sockets } = setUp();
    expect(connection.send({ pause: {} })).toBe(false);
    sockets[0]!.open();
    expect(connection.send({ id: "a", pause: {} })).toBe(true);
    expect(sockets[0]!.sent).toEqual(['{"id":"a","pause":{}}']);
  });

  it("goes on after a message that it cannot read", () => {
    const { sockets, messages, troubles } = setUp();
    sockets[0]!.open();
    for (const data of ["{", "[]", "null", '{"unheard":{}}', '{"status":3}']) sockets[0]!.onmessage?.({ data });
    expect(troubles).toHaveLength(5);
    sockets[0]!.onmessage?.({ data: '{"error":{"message":"no"}}' });
    sockets[0]!.onmessage?.({ data: new ArrayBuffer(3) });
    expect(messages).toEqual([{ kind: "error", body: { message: "no" } }, 3]);
  });

  it("stays closed once it was stopped", async () => {
    const { connection, sockets, timers } = setUp();
    sockets[0]!.open();
    connection.stop();
    await settle();
    expect(timers).toHaveLength(0);
  });

  it("says that page and simulation are of different versions, and does not ask again and again", () => {
    const { sockets, timers, states, troubles } = setUp();
    sockets[0]!.open();
    sockets[0]!.onmessage!({ data: JSON.stringify({ hello: { protocol: 1 } }) });
    expect(states.at(-1)![0]).toBe("dismissed");
    expect(states.at(-1)![1]).toMatch(/speaks protocol 1, this page 2\. The simulation is older than this page/);
    expect([timers.length, troubles.length]).toEqual([0, 0]);
  });
});
