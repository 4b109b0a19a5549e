/** Has a pipeline checked away from the thread that draws: of several that wait only the newest is. */
import type { PipelineErrors, PipelineQuestion } from "../kernel/language";

/** The part of a worker that is needed, so that a test can stand in for it. */
export interface CheckWorker {
  postMessage(message: unknown): void;
  terminate(): void;
  onmessage: ((event: MessageEvent<CheckAnswer>) => void) | null;
  onerror: ((event: ErrorEvent) => void) | null;
}

/** What the worker answers: the errors of the text, or why it could not be checked. */
export type CheckAnswer = PipelineErrors | { failure: string };

export class Checker {
  private worker: CheckWorker | null = null;
  private underway: ((answer: CheckAnswer) => void) | null = null;
  private waiting: { question: PipelineQuestion; answered: (answer: CheckAnswer) => void } | null = null;

  /** `start` makes the worker when it is first needed. */
  constructor(private readonly start: () => CheckWorker) {}

  check(question: PipelineQuestion, answered: (answer: CheckAnswer) => void): void {
    this.waiting = { question, answered };
    if (!this.underway) this.next();
  }

  private next(): void {
    const { waiting } = this;
    this.waiting = null;
    this.underway = waiting?.answered ?? null;
    if (!waiting) return;
    this.worker ??= this.started();
    this.worker.postMessage(waiting.question);
  }

  private started(): CheckWorker {
    const worker = this.start();
    worker.onmessage = ({ data }) => this.take(data);
    // One that could not start answers nothing: the next question is another's.
    worker.onerror = ({ message }) => {
      worker.terminate();
      this.worker = null;
      this.take({ failure: message || "what checks it could not be started" });
    };
    return worker;
  }

  private take(answer: CheckAnswer): void {
    const answered = this.underway;
    this.next();
    answered?.(answer);
  }
}
