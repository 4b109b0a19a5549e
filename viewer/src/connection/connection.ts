/**
 * The connection to the running simulation. It comes back by itself, waiting a little longer after each failure, and says
 * in one word how it stands.
 */
import { PROTOCOL_VERSION, VersionError, parseServerMessage } from "./protocol";
import type { ClientMessage, ServerMessage } from "./protocol";

export type ConnectionState = "connecting" | "connected" | "reconnecting" | "refused" | "dismissed" | "ended";

/** The part of the browser that a connection needs, so that a test can stand in for it. */
export interface Surroundings {
  open(address: string): WebSocket;
  /** How the address answers an ordinary request; null when nothing answers. */
  probe(address: string): Promise<{ status: number; text: string } | null>;
  setTimer(action: () => void, milliseconds: number): number;
  clearTimer(timer: number): void;
  random(): number;
}

export interface Listener {
  state(state: ConnectionState, explanation: string): void;
  message(message: ServerMessage): void;
  binary(bytes: ArrayBuffer): void;
  trouble(message: string): void;
}

const FIRST_DELAY = 250;
const LONGEST_DELAY = 8000;
const REFUSED_DELAY = 5000;

/** A connection on which nothing comes for this long is lost: the server tells a status every ten seconds at least. */
export const SILENCE = 25000;

/** Milliseconds to wait before attempt number `attempt` (from 0): doubling, bounded, spread by up to a quarter. */
export function backOff(attempt: number, random: number): number {
  const base = Math.min(LONGEST_DELAY, FIRST_DELAY * 2 ** Math.min(attempt, 16));
  return Math.round(base * (0.75 + 0.5 * random));
}

/** The addresses of the page's own server. The browser shows its cookie there, which no script can read. */
export function streamAddress(page: string): { [name in "address" | "probe" | "surface" | "stack" | "schema" | "pipelines" | "pipelineSchema"]: string } {
  const place = (name: string): URL => new URL(name, page);
  const stream = place("ws");
  const probe = stream.toString();
  stream.protocol = stream.protocol === "https:" ? "wss:" : "ws:";
  return {
    address: stream.toString(), probe, surface: place("surface").toString(), stack: place("stack").toString(),
    schema: place("schema/order").toString(), pipelines: place("pipelines").toString(),
    pipelineSchema: place("schema").toString(),
  };
}

/** What a viewer is called, and what it shows to come back under that name after its connection was lost. */
export interface Identity { client: string; back: string }

/** The codes with which the server closes a connection for good, or because the viewer has another. */
const ENDED = 1000, RETURNING = 4000, KICKED = 4001, REPLACED = 4002;

export const browserSurroundings: Surroundings = {
  open: (address) => new WebSocket(address),
  probe: async (address) => {
    try {
      const response = await fetch(address, { cache: "no-store", redirect: "error" });
      return { status: response.status, text: (await response.text()).slice(0, 300).trim() };
    } catch {
      return null;
    }
  },
  setTimer: (action, milliseconds) => window.setTimeout(action, milliseconds),
  clearTimer: (timer) => window.clearTimeout(timer),
  random: Math.random,
};

export class Connection {
  private socket: WebSocket | null = null;
  private attempt = 0;
  private timer: number | null = null;
  /** Runs out when nothing was heard for too long. */
  private patience: number | null = null;
  private closed = false;
  state: ConnectionState = "connecting";
  /** Who this viewer is: shown when it comes back, so that it finds the wheel where it left it. */
  identity: Identity | null = null;

  constructor(
    private readonly target: { address: string; probe: string },
    private readonly listener: Listener,
    private readonly surroundings: Surroundings = browserSurroundings,
  ) {}

  start(): void {
    this.closed = false;
    this.open();
  }

  /** Ends the connection for good. */
  stop(): void {
    this.closed = true;
    this.clearTimer();
    this.letGo();
    this.change("ended", "");
  }

  /** Ends the connection because this page can do nothing with it, and says why; `retry` begins another. */
  dismiss(why: string): void {
    if (this.closed) return;
    this.clearTimer();
    this.letGo();
    this.change("dismissed", why);
  }

  /** Tries again at once, if a connection is not there already; an attempt that hangs is given up. */
  retry(): void {
    if (this.state === "connected" || this.state === "ended") return;
    this.attempt = 0;
    this.clearTimer();
    this.open();
  }

  /** Sends a message; false when there is no connection to send it on. */
  send(message: ClientMessage): boolean {
    if (!this.socket || this.socket.readyState !== 1) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** Tells how many frames of this connection have been decoded, so that the server sends the next. */
  acknowledge(frames: number): void {
    if (this.socket?.readyState === 1) this.socket.send(BigUint64Array.of(BigInt(frames)));
  }

  /** Gives the connection up and opens another. */
  renew(reason: string): void {
    if (!this.socket) return;
    this.letGo(RETURNING);
    this.again("reconnecting", reason, backOff(this.attempt++, this.surroundings.random()));
  }

  /** Closes the socket; what still comes of it is not heard. Without a code the run keeps the wheel for nobody. */
  private letGo(code?: number): void {
    const { socket } = this;
    this.socket = null;
    this.stopListening();
    socket?.close(code);
  }

  /** Begins to wait for the next sign of life. */
  private listen(): void {
    this.stopListening();
    this.patience = this.surroundings.setTimer(() => this.renew(`Nothing was heard for ${SILENCE / 1000} seconds.`), SILENCE);
  }

  private stopListening(): void {
    if (this.patience !== null) this.surroundings.clearTimer(this.patience);
    this.patience = null;
  }

  private change(state: ConnectionState, explanation: string): void {
    this.state = state;
    this.listener.state(state, explanation);
  }

  private open(): void {
    // One that was being opened is not waited for any more.
    this.letGo(RETURNING);
    let socket: WebSocket;
    try {
      const identity = this.identity === null ? "" : `?${new URLSearchParams({ ...this.identity }).toString()}`;
      socket = this.surroundings.open(this.target.address + identity);
    } catch (error) {
      this.again("reconnecting", error instanceof Error ? error.message : String(error), backOff(this.attempt++, this.surroundings.random()));
      return;
    }
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.listen();
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.change("connected", "");
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.socket !== socket) return;
      this.listen();
      if (typeof event.data !== "string") {
        this.listener.binary(event.data);
        return;
      }
      let message: ServerMessage;
      try {
        message = parseServerMessage(event.data);
      } catch (error) {
        if (error instanceof VersionError) {
          const older = typeof error.found === "number" && error.found < PROTOCOL_VERSION;
          return this.dismiss(`This page and the simulation do not understand each other: ${error.message}. `
            + (older ? "The simulation is older than this page: open the page that it serves itself." : "Reload the page to get the one that belongs to the simulation."));
        }
        this.listener.trouble(error instanceof Error ? error.message : String(error));
        return;
      }
      // Only a server that has something to say ends the waiting: one that closes at once is not asked ever faster.
      this.attempt = 0;
      this.listener.message(message);
    };
    socket.onclose = (event: CloseEvent) => {
      if (this.socket !== socket) return;
      this.letGo();
      if (this.closed) return;
      // The server's farewell: there is nothing to come back to.
      if (event.code === ENDED) return this.change("ended", "");
      if (event.code === KICKED) return this.change("dismissed", "The viewer that steers has ended this connection.");
      // Another tab, copied from this one, goes by its name.
      if (event.code === REPLACED) this.identity = null;
      void this.lost(opened, event.reason);
    };
  }

  private async lost(opened: boolean, reason: string): Promise<void> {
    // A browser does not say why an opening failed; an ordinary request to the same address does.
    const answer = opened ? null : await this.surroundings.probe(this.target.probe);
    if (this.closed || this.socket) return;
    if (answer?.status === 401) {
      this.again("refused", "The simulation does not know this browser, or another one runs here now.", REFUSED_DELAY);
    } else if (answer?.status === 403) {
      this.again("refused", `The simulation does not accept this address: ${answer.text}.`, REFUSED_DELAY);
    } else {
      const what = reason !== "" ? `The simulation closed the connection: ${reason}.` : opened ? "The connection was lost." : "The simulation does not answer.";
      this.again("reconnecting", what, backOff(this.attempt++, this.surroundings.random()));
    }
  }

  private again(state: ConnectionState, explanation: string, delay: number): void {
    this.change(state, explanation);
    this.clearTimer();
    this.timer = this.surroundings.setTimer(() => {
      this.timer = null;
      this.open();
    }, delay);
  }

  private clearTimer(): void {
    if (this.timer !== null) this.surroundings.clearTimer(this.timer);
    this.timer = null;
  }
}
