/** The pipelines of the run as they are now, and changes to them: one on its way at a time, the newest wish next. */
import type { ClientMessage, Json } from "./protocol";
import { readPipelines } from "../store/pipelines";
import type { Pipeline } from "../store/pipelines";

export class Pipelines {
  private known: readonly Pipeline[] = [];
  private changes = -1;
  private underway: string | null = null;
  private wish: ClientMessage | null = null;
  /** What was set here last, as long as the run has not answered: until then it counts for more than what the run has. */
  private wanted: Pipeline | null = null;
  private readonly listeners: (() => void)[] = [];

  /** `ask` sends a message and says under what name; null where there is no connection. */
  constructor(private readonly load: () => Promise<Json>, private readonly ask: (message: ClientMessage) => string | null, private readonly failed: (reason: string) => void) {}

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  get all(): readonly Pipeline[] {
    return this.known;
  }

  get(name: string | null): Pipeline | undefined {
    return this.known.find((pipeline) => pipeline.name === name);
  }

  /** The run says how often its pipelines have changed. */
  async told(changes: number): Promise<void> {
    if (changes === this.changes) return;
    this.changes = changes;
    try {
      const loaded = readPipelines(await this.load());
      this.known = this.wanted ? replaced(loaded, this.wanted) : loaded;
      for (const listener of this.listeners) listener();
    } catch (error) {
      this.changes = -1;
      this.failed(String(error));
    }
  }

  set(pipeline: Pipeline): void {
    this.known = replaced(this.known, pipeline);
    this.wanted = pipeline;
    this.send({ pipelines: { set: [pipeline] } });
  }

  remove(name: string): void {
    this.send({ pipelines: { remove: [name] } });
  }

  /** A change has been made or refused; says whether it was one from here. */
  answered(id: string | null | undefined): boolean {
    if (!id || id !== this.underway) return false;
    this.underway = null;
    const { wish } = this;
    this.wish = null;
    if (wish) this.send(wish);
    else this.wanted = null;
    return true;
  }

  /** What was on its way is lost with the connection. */
  forget(): void {
    this.underway = this.wish = this.wanted = null;
  }

  private send(message: ClientMessage): void {
    if (this.underway !== null) this.wish = message;
    else this.underway = this.ask(message);
  }
}

/** The pipelines with one in the place of that of its name, or behind them. */
const replaced = (pipelines: readonly Pipeline[], by: Pipeline): Pipeline[] =>
  (pipelines.some(({ name }) => name === by.name) ? pipelines.map((known) => (known.name === by.name ? by : known)) : [...pipelines, by]);
