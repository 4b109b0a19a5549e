/**
 * What comes from the run: the connection, and behind it the decoder of its frames. It can begin before there is a page to show
 * anything: what comes until then is kept in its order. Frames that are kept are not acknowledged, so that the run sends no more.
 */
import { Connection } from "./connection";
import type { ConnectionState, Surroundings } from "./connection";
import { Decoder } from "./decoder";
import type { DecodeWorker } from "./decoder";
import type { Frame, ServerMessage } from "./protocol";

export interface StreamListener {
  state(state: ConnectionState, explanation: string): void;
  message(message: ServerMessage): void;
  /** Something came, which is yet to be decoded. */
  alive(): void;
  frame(frame: Frame): void;
  trouble(text: string): void;
}

export class Stream {
  readonly connection: Connection;
  private readonly decoder: Decoder;
  private listener: StreamListener | null = null;
  private readonly kept: ((listener: StreamListener) => void)[] = [];
  /** Frames of this connection that were decoded before somebody listened. */
  private unacknowledged = 0;
  /** Why no frame can ever be decoded on this page; empty where they can. */
  private failure = "";

  constructor(target: { address: string; probe: string }, worker: DecodeWorker, surroundings?: Surroundings) {
    this.connection = new Connection(target, {
      state: (state, explanation) => {
        // Behind the end of a run nothing follows: what has come of it is still shown.
        if (state !== "connected" && state !== "ended") {
          this.decoder.clear();
          this.unacknowledged = 0;
        }
        this.tell((listener) => listener.state(state, explanation));
      },
      message: (message) => this.tell((listener) => listener.message(message)),
      binary: (bytes) => {
        this.tell((listener) => listener.alive());
        if (this.failure === "") this.decoder.push(bytes);
        else this.connection.dismiss(this.failure);
      },
      trouble: (text) => this.tell((listener) => listener.trouble(text)),
    }, surroundings);
    this.decoder = new Decoder(worker, {
      frame: (frame) => this.tell((listener) => listener.frame(frame)),
      decoded: (count) => {
        if (this.listener) this.connection.acknowledge(count);
        else this.unacknowledged = count;
      },
      lost: (reason) => this.connection.renew(`A frame could not be read: ${reason}.`),
    });
  }

  /** Gives the connection up: what decodes frames could not be started. */
  fail(reason: string): void {
    if (this.failure !== "") return;
    this.failure = `This page cannot show the simulation: ${reason}. Reload the page.`;
    this.connection.dismiss(this.failure);
  }

  /** Hands out what was kept, and from now on whatever comes. */
  listen(listener: StreamListener): void {
    this.listener = listener;
    for (const event of this.kept.splice(0)) event(listener);
    if (this.unacknowledged > 0) this.connection.acknowledge(this.unacknowledged);
  }

  private tell(event: (listener: StreamListener) => void): void {
    if (this.listener) event(this.listener);
    else this.kept.push(event);
  }
}
