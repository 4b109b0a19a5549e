/** The pipelines of the run as they are now, and changes to them: one on its way at a time, then the newest wish for each pipeline. */
import type { ClientMessage, Json } from "./protocol";
import { readPipelines } from "../store/pipelines";
import type { Pipeline } from "../store/pipelines";

/** Milliseconds after which what could not be loaded is asked for again: at first, and at most. */
const FIRST_REST = 1000;
const LONGEST_REST = 30_000;

export class Pipelines {
  /** As the run has told them last. */
  private loaded: readonly Pipeline[] = [];
  /** The same with what is wanted here. */
  private known: readonly Pipeline[] = [];
  private changes = -1;
  private underway: { id: string; name: string; message: ClientMessage } | null = null;
  /** What is to be sent next, by the pipeline that it is of: a wish takes the place of an older one for the same pipeline alone. */
  private readonly wishes = new Map<string, ClientMessage>();
  /** What was set here last of each pipeline, as long as the run has not answered: until then it counts for more than what the run has. */
  private readonly wanted = new Map<string, Pipeline>();
  /** Counts what is asked for, so that an answer to what was asked before is known as such. */
  private loads = 0;
  private retry: ReturnType<typeof setTimeout> | undefined;
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
    await this.reload();
  }

  /** Asks for the pipelines of the run, again and again until they are there. */
  async reload(rest = FIRST_REST): Promise<void> {
    clearTimeout(this.retry);
    const load = ++this.loads;
    try {
      const loaded = readPipelines(await this.load());
      // Two answers may come in another order than they were asked for.
      if (load === this.loads) this.take(loaded);
    } catch (error) {
      if (load !== this.loads) return;
      if (rest === FIRST_REST) this.failed(String(error));
      this.retry = setTimeout(() => void this.reload(Math.min(2 * rest, LONGEST_REST)), rest);
    }
  }

  set(pipeline: Pipeline): void {
    const { name } = pipeline;
    if (!this.send(name, { pipelines: { set: [pipeline] } })) return;
    this.wanted.set(name, pipeline);
    this.known = replaced(this.known, pipeline);
  }

  remove(name: string): void {
    // A second removal would be refused, for there is nothing left to remove.
    if (this.underway?.name === name && isRemoval(this.underway.message) && !this.wishes.has(name)) return;
    if (this.send(name, { pipelines: { remove: [name] } })) this.wanted.delete(name);
  }

  /** The pipeline that a change on its way is of; null where it is no change from here. */
  changedBy(id: string | null | undefined): string | null {
    return id && id === this.underway?.id ? this.underway.name : null;
  }

  /** Whether a change of a pipeline was asked for and is not answered yet. */
  isOnItsWay(name: string): boolean {
    return this.underway?.name === name || this.wishes.has(name);
  }

  /** A change has been made or refused; says whether it was one from here. */
  answered(id: string | null | undefined): boolean {
    const { underway } = this;
    if (!id || id !== underway?.id) return false;
    this.underway = null;
    const [next] = this.wishes;
    if (next) {
      this.wishes.delete(next[0]);
      if (!this.send(...next)) this.wanted.delete(next[0]);
    }
    if (!this.isOnItsWay(underway.name)) this.wanted.delete(underway.name);
    return true;
  }

  /** What was on its way is lost with the connection, and what the run has is to be asked for anew. */
  forget(): void {
    this.underway = null;
    this.wishes.clear();
    this.wanted.clear();
    this.changes = -1;
    this.loads++;
    clearTimeout(this.retry);
    if (this.known !== this.loaded) this.take(this.loaded);
  }

  private take(loaded: readonly Pipeline[]): void {
    this.loaded = loaded;
    this.known = [...this.wanted.values()].reduce<readonly Pipeline[]>(replaced, loaded);
    for (const listener of this.listeners) listener();
  }

  /** Sends a change, or keeps it until that on its way is answered; says whether there is a connection. */
  private send(name: string, message: ClientMessage): boolean {
    if (this.underway !== null) {
      this.wishes.set(name, message);
      return true;
    }
    const id = this.ask(message);
    if (id !== null) this.underway = { id, name, message };
    return id !== null;
  }
}

const isRemoval = (message: ClientMessage): boolean => "pipelines" in message && "remove" in (message.pipelines as object);

/** The pipelines with one in the place of that of its name, or behind them. */
const replaced = (pipelines: readonly Pipeline[], by: Pipeline): Pipeline[] =>
  (pipelines.some(({ name }) => name === by.name) ? pipelines.map((known) => (known.name === by.name ? by : known)) : [...pipelines, by]);
