/**
 * The connection to the running simulation. It comes back by itself, waiting a little longer after each failure, and says
 * in one word how it stands.
 */
import { parseServerMessage } from "./protocol";
import type { ClientMessage, ServerMessage } from "./protocol";

export type ConnectionState = "connecting" | "connected" | "reconnecting" | "refused";

/** The part of the browser that a connection needs, so that a test can stand in for it. */
export interface Surroundings {
  open(address: string): WebSocket;
  /** The HTTP status with which the address answers an ordinary request; null when nothing answers. */
  probe(address: string): Promise<number | null>;
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

/** The WebSocket address of the page's own server and the token, from the page's address (`?token=` or `#token=`). */
export function streamAddress(page: string): { address: string; probe: string; token: string } {
  const url = new URL(page);
  const token = url.searchParams.get("token") ?? new URLSearchParams(url.hash.slice(1)).get("token") ?? "";
  const stream = new URL("ws", url);
  stream.search = new URLSearchParams({ token }).toString();
  stream.hash = "";
  const probe = stream.toString();
  stream.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return { address: stream.toString(), probe, token };
}

export const browserSurroundings: Surroundings = {
  open: (address) => new WebSocket(address),
  probe: async (address) => {
    try {
      return (await fetch(address, { cache: "no-store", redirect: "error" })).status;
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

  private change(state: ConnectionState, explanation: string): void {
    this.state = state;
    this.listener.state(state, explanation);
  }

  private open(): void {
    let socket: WebSocket;
    try {
      socket = this.surroundings.open(this.target.address);
    } catch (error) {
      this.again("reconnecting", error instanceof Error ? error.message : String(error), backOff(this.attempt++, this.surroundings.random()));
      return;
    }
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.attempt = 0;
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
      this.listener.message(message);
    };
    socket.onclose = (event: CloseEvent) => {
      if (this.socket !== socket) return;
      this.socket = null;
      if (!this.closed) void this.lost(opened, event.code, event.reason);
    };
  }

  private async lost(opened: boolean, code: number, reason: string): Promise<void> {
    if (code === 1008 || code === 4401 || code === 4403) {
      this.refuse(reason);
      return;
    }
    // A browser does not say why an opening failed; an ordinary request to the same address does.
    if (!opened) {
      const status = await this.surroundings.probe(this.target.probe);
      if (this.closed) return;
      if (status === 401 || status === 403) {
        this.refuse("");
        return;
      }
    }
    const delay = backOff(this.attempt++, this.surroundings.random());
    this.again("reconnecting", opened ? "The connection was lost." : "The simulation does not answer.", delay);
  }

  private refuse(reason: string): void {
    const what = this.target.token === "" ? "The link has no token." : "The simulation does not accept the token in this link.";
    this.again("refused", reason && this.target.token !== "" ? `${what} (${reason})` : what, REFUSED_DELAY);
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
