import { describe, expect, it } from "vitest";
import type { DecodeWorker } from "../../src/connection/decoder";
import { Stream } from "../../src/connection/stream";

/** A socket and a decoder that answer when they are told to; the frame of a message has its first byte as its cycle. */
function setUp() {
  const sockets: { readyState: number; sent: unknown[]; onopen?: () => void; onmessage?: (event: { data: string | ArrayBuffer }) => void; onclose?: (event: { code: number; reason: string }) => void; send(text: unknown): void; close(): void }[] = [];
  const timers: (() => void)[] = [];
  const waiting: ArrayBuffer[] = [];
  const worker: DecodeWorker = { onmessage: null, postMessage: (message) => waiting.push(message) };
  const stream = new Stream({ address: "ws://x/ws", probe: "http://x/ws" }, worker, {
    open: () => {
      const socket: (typeof sockets)[number] = { readyState: 1, sent: [], send: (text) => socket.sent.push(text), close: () => undefined };
      sockets.push(socket);
      return socket as unknown as WebSocket;
    },
    probe: async () => null, setTimer: (action) => timers.push(action), clearTimer: () => undefined, random: () => 0.5,
  });
  const heard: string[] = [];
  const explained: string[] = [];
  const listen = (): void => stream.listen({
    state: (state, explanation) => {
      heard.push(state);
      if (explanation !== "") explained.push(explanation);
    }, message: ({ kind }) => heard.push(kind), alive: () => heard.push("alive"),
    frame: (frame) => heard.push(`frame ${frame.kind === "data" ? frame.cycle : "topology"}`), trouble: (text) => heard.push(text),
  });
  const decode = (): void => {
    const cycle = new Uint8Array(waiting.shift()!)[0]!;
    worker.onmessage?.({ data: { frames: [{ kind: "data", view: "a", topology: "t", cycle, time: 0, points: new Float32Array(0), fields: [] }] } } as MessageEvent);
  };
  const bring = (...cycles: number[]): void => { for (const cycle of cycles) sockets.at(-1)!.onmessage!({ data: Uint8Array.of(cycle).buffer }); };
  const acknowledged = (): number[] => sockets.at(-1)!.sent.map((sent) => Number((sent as BigUint64Array)[0]));
  stream.connection.start();
  sockets[0]!.onopen!();
  return { stream, sockets, heard, explained, waiting, listen, decode, bring, acknowledged };
}

describe("the stream", () => {
  it("keeps what comes before somebody listens, in its order, and asks for no more frames until then", () => {
    const { heard, listen, decode, bring, acknowledged } = setUp();
    bring(1, 2);
    decode();
    decode();
    expect(acknowledged()).toEqual([]);
    listen();
    expect(heard).toEqual(["connected", "alive", "alive", "frame 1", "frame 2"]);
    expect(acknowledged()).toEqual([2]);
    bring(3);
    decode();
    expect(heard.slice(5)).toEqual(["alive", "frame 3"]);
    expect(acknowledged()).toEqual([2, 3]);
  });

  it("ends with a word where nothing can be decoded, and takes no more frames", () => {
    const { stream, sockets, heard, explained, waiting, listen, bring } = setUp();
    bring(1);
    stream.fail("the geometry kernel did not arrive: 503 Service Unavailable");
    listen();
    expect(heard).toEqual(["connected", "alive", "dismissed"]);
    expect(explained).toEqual(["This page cannot show the simulation: the geometry kernel did not arrive: 503 Service Unavailable. Reload the page."]);
    stream.connection.retry();
    sockets.at(-1)!.onopen!();
    bring(2, 3);
    expect([sockets.length, waiting.length, heard.slice(3)]).toEqual([2, 1, ["connected", "alive", "dismissed"]]);
    expect(explained[1]).toBe(explained[0]);
  });

  it("still shows what has come of a run that has ended", () => {
    const { stream, heard, listen, decode, bring } = setUp();
    listen();
    bring(1, 2);
    stream.connection.stop();
    decode();
    decode();
    expect(heard).toEqual(["connected", "alive", "alive", "ended", "frame 1", "frame 2"]);
  });

  it("acknowledges nothing of a connection that is gone", async () => {
    const { stream, sockets, listen, decode, bring, acknowledged } = setUp();
    bring(1);
    decode();
    sockets[0]!.onclose!({ code: 1006, reason: "" });
    await new Promise((resolve) => setTimeout(resolve, 0));
    stream.connection.start();
    sockets.at(-1)!.onopen!();
    listen();
    expect(acknowledged()).toEqual([]);
    bring(2);
    decode();
    expect(acknowledged()).toEqual([1]);
  });
});
