/**
 * The queue in front of the decoder: the newest data of a view replaces data of the same view that still waits, so that
 * decoding keeps up with any stream. A topology is never left out, and never overtaken.
 */
import { peekFrame } from "./protocol";
import type { Frame } from "./protocol";
import type { DecodeAnswer } from "./decode.worker";

/** What decodes: a Worker, or something that looks like one in a test. */
export interface DecodeWorker {
  onmessage: ((event: MessageEvent<DecodeAnswer>) => void) | null;
  postMessage(message: ArrayBuffer, transfer: Transferable[]): void;
}

interface Waiting { view: string; kind: "topology" | "data"; bytes: ArrayBuffer }

export class Decoder {
  private waiting: Waiting[] = [];
  private busy = false;
  private generation = 0;
  private sent = 0;
  /** Frames left out because a newer one of the same view was there already. */
  dropped = 0;

  constructor(
    private readonly worker: DecodeWorker,
    private readonly onFrame: (frame: Frame) => void,
    private readonly onError: (message: string) => void,
  ) {
    worker.onmessage = (event) => this.answer(event.data);
  }

  push(bytes: ArrayBuffer): void {
    let peek: { kind: "topology" | "data"; view: string };
    try {
      peek = peekFrame(new Uint8Array(bytes));
    } catch (error) {
      this.onError(error instanceof Error ? error.message : String(error));
      return;
    }
    if (peek.kind === "data") {
      const before = this.waiting.length;
      this.waiting = this.waiting.filter((item) => item.kind === "topology" || item.view !== peek.view);
      this.dropped += before - this.waiting.length;
    }
    this.waiting.push({ ...peek, bytes });
    this.next();
  }

  /** Forgets everything that waits: the connection it came from is gone. */
  clear(): void {
    this.waiting = [];
    this.generation++;
  }

  private next(): void {
    if (this.busy) return;
    const item = this.waiting.shift();
    if (!item) return;
    this.busy = true;
    this.sent = this.generation;
    this.worker.postMessage(item.bytes, [item.bytes]);
  }

  private answer(answer: DecodeAnswer): void {
    this.busy = false;
    if (this.sent === this.generation) {
      if ("frame" in answer) this.onFrame(answer.frame);
      else this.onError(answer.error);
    }
    this.next();
  }
}
