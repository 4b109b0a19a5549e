/**
 * The connection to the running simulation. It comes back by itself, waiting a little longer after each failure, and says
 * in one word how it stands.
 */
import { parseServerMessage } from "./protocol";
import type { ClientMessage, ServerMessage } from "./protocol";

export type ConnectionState = "connecting" | "connected" | "reconnecting" | "refused" | "ended";

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

/** Milliseconds to wait before attempt number `attempt` (from 0): doubling, bounded, spread by up to a quarter. */
export function backOff(attempt: number, random: number): number {
  const base = Math.min(LONGEST_DELAY, FIRST_DELAY * 2 ** Math.min(attempt, 16));
  return Math.round(base * (0.75 + 0.5 * random));
}

/** The addresses of the page's own server and the token, from the page's address (`?token=` or `#token=`). */
export function streamAddress(page: string): { address: string; probe: string; token: string; surface: string } {
  const url = new URL(page);
  const token = url.searchParams.get("token") ?? new URLSearchParams(url.hash.slice(1)).get("token") ?? "";
  const stream = new URL("ws", url);
  stream.search = new URLSearchParams({ token }).toString();
  stream.hash = "";
  const probe = stream.toString();
  stream.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  const surface = new URL("surface", url);
  surface.search = stream.search;
  surface.hash = "";
  return { address: stream.toString(), probe, token, surface: surface.toString() };
}

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
  private closed = false;
  state: ConnectionState = "connecting";
  /** What the server calls this viewer: named when it comes back, so that it finds the wheel where it left it. */
  client: string | null = null;

  constructor(
    private readonly target: { address: string; probe: string; token: string },
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
    this.socket?.close();
  }

  /** Tries again at once, if a connection is not there already. */
  retry(): void {
    if (this.state === "connected" || this.timer === null) return;
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
    const socket = this.socket;
    if (!socket) return;
    this.socket = null;
    socket.close();
    this.again("reconnecting", reason, backOff(this.attempt++, this.surroundings.random()));
  }

  private change(state: ConnectionState, explanation: string): void {
    this.state = state;
    this.listener.state(state, explanation);
  }

  private open(): void {
    let socket: WebSocket;
    try {
      const client = this.client === null ? "" : `&client=${encodeURIComponent(this.client)}`;
      socket = this.surroundings.open(this.target.address + client);
    } catch (error) {
      this.again("reconnecting", error instanceof Error ? error.message : String(error), backOff(this.attempt++, this.surroundings.random()));
      return;
    }
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.change("connected", "");
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data !== "string") {
        this.listener.binary(event.data);
        return;
      }
      let message: ServerMessage;
      try {
        message = parseServerMessage(event.data);
      } catch (error) {
        this.listener.trouble(error instanceof Error ? error.message : String(error));
        return;
      }
      // Only a server that has something to say ends the waiting: one that closes at once is not asked ever faster.
      this.attempt = 0;
      this.listener.message(message);
    };
    socket.onclose = (event: CloseEvent) => {
      if (this.socket !== socket) return;
      this.socket = null;
      if (this.closed) return;
      // The server's farewell: there is nothing to come back to.
      if (event.code === 1000) this.change("ended", "");
      else void this.lost(opened, event.reason);
    };
  }

  private async lost(opened: boolean, reason: string): Promise<void> {
    // A browser does not say why an opening failed; an ordinary request to the same address does.
    const answer = opened ? null : await this.surroundings.probe(this.target.probe);
    if (this.closed) return;
    if (answer?.status === 401) {
      this.again("refused", this.target.token === "" ? "The link has no token." : "The simulation does not accept the token in this link.", REFUSED_DELAY);
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
