/**
 * The queue in front of the decoder. Frames are decoded in the order in which they came, since each goes on from the one before
 * it; the server is told how many were, and sends no more than two of a view ahead.
 */
import type { Frame } from "./protocol";
import type { DecodeAnswer } from "./decode.worker";

/** What decodes: a Worker, or something that looks like one in a test. */
export interface DecodeWorker {
  onmessage: ((event: MessageEvent<DecodeAnswer>) => void) | null;
  postMessage(message: ArrayBuffer, transfer: Transferable[]): void;
}

export interface DecoderEvents {
  frame(frame: Frame): void;
  /** So many frames of this connection have been decoded. */
  decoded(count: number): void;
  /** A frame cannot be read, nor any after it: only a new connection helps. */
  lost(reason: string): void;
}

/**
 * The most bytes that wait. The server sends two frames of a view ahead, but does not count as long as none was acknowledged: a decoder
 * that never begins would otherwise fill the memory.
 */
export const MOST_WAITING = 512 * 2 ** 20;

export class Decoder {
  private waiting: ArrayBuffer[] = [];
  private bytes = 0;
  private busy = false;
  private generation = 0;
  private sent = 0;
  private count = 0;

  constructor(private readonly worker: DecodeWorker, private readonly events: DecoderEvents) {
    worker.onmessage = (event) => this.answer(event.data);
  }

  push(message: ArrayBuffer): void {
    if (this.waiting.length > 0 && this.bytes + message.byteLength > MOST_WAITING) {
      this.clear();
      return this.events.lost(`more than ${MOST_WAITING / 2 ** 20} MiB of frames wait to be decoded`);
    }
    this.waiting.push(message);
    this.bytes += message.byteLength;
    this.next();
  }

  /** Forgets everything that waits: the connection it came from is gone. */
  clear(): void {
    this.waiting = [];
    this.bytes = 0;
    this.count = 0;
    this.generation++;
  }

  private next(): void {
    if (this.busy) return;
    const message = this.waiting.shift();
    if (!message) return;
    this.bytes -= message.byteLength;
    this.busy = true;
    this.sent = this.generation;
    this.worker.postMessage(message, [message]);
  }

  private answer(answer: DecodeAnswer): void {
    this.busy = false;
    if (this.sent === this.generation) {
      if ("error" in answer) this.events.lost(answer.error);
      else {
        for (const frame of answer.frames) this.events.frame(frame);
        this.events.decoded(++this.count);
      }
    }
    this.next();
  }
}
