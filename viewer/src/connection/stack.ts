/** The stack of edits: the server says how many there are, and those that are not here yet are fetched. */
import { backOff, browserSurroundings } from "./connection";
import type { Surroundings } from "./connection";
import type { Json, StackInformation } from "./protocol";

interface Answer { revision: number; count: number; edits: Json[] }

/** Asks the server for the edits from one on; it answers with as many as it sends at once. */
export type FetchEdits = (address: string) => Promise<Answer>;

const fetchEdits: FetchEdits = async (address) => {
  const response = await fetch(address, { cache: "no-store" });
  if (!response.ok) throw new Error(`the server answers with ${response.status}`);
  const answer = (await response.json()) as Partial<Answer>;
  if (typeof answer.revision !== "number" || !Array.isArray(answer.edits)) throw new Error("the server's answer is no list of edits");
  return answer as Answer;
};

export interface StackEvents {
  /** The stack is another one, and its edits are not here yet. */
  awaited(): void;
  /** All edits are here. */
  changed(): void;
  trouble(text: string): void;
}

export class Stack {
  /** The edits of the shape when all of them were here last, the oldest first; a new array for each change. */
  edits: Json[] = [];
  /** Those that are here of the edits of now. */
  private here = this.edits;
  /** What the server has said last. */
  told: StackInformation = { revision: -1, edits: 0 };
  private connection = 0;
  private loading = false;
  /** How often loading has failed since the server last answered with edits. */
  private failures = 0;
  private timer: number | null = null;

  constructor(
    private readonly address: string, private readonly events: StackEvents,
    private readonly ask: FetchEdits = fetchEdits,
    private readonly surroundings: Pick<Surroundings, "setTimer" | "clearTimer" | "random"> = browserSurroundings,
  ) {}

  /** Whether `edits` are those of the run. */
  get isWhole(): boolean {
    return this.edits === this.here;
  }

  /** What the first message of a connection says: it may be another run. */
  begin(told: StackInformation): void {
    this.connection++;
    this.loading = false;
    this.failures = 0;
    this.take(told, []);
  }

  /** The stack has changed: all but the first `kept` edits. */
  change(told: StackInformation): void {
    if (told.revision <= this.told.revision) return;
    this.take(told, this.here.slice(0, told.kept ?? 0));
  }

  private take(told: StackInformation, here: Json[]): void {
    this.told = told;
    this.here = here;
    void this.load();
    if (!this.isWhole) this.events.awaited();
  }

  private async load(): Promise<void> {
    this.wait(null);
    if (this.loading) return;
    this.loading = true;
    const connection = this.connection;
    try {
      while (this.here.length < this.told.edits) {
        const { here } = this;
        const answer = await this.ask(`${this.address}?from=${here.length}&revision=${this.told.revision}`);
        if (connection !== this.connection) return;
        // The message that says what has changed is still on its way; it loads the rest.
        if (answer.revision > this.told.revision) return;
        // Asked for before that message came: what is missing now may begin elsewhere.
        if (answer.revision < this.told.revision || here !== this.here) continue;
        if (answer.edits.length === 0) throw new Error("the server has fewer edits than it says");
        this.failures = 0;
        this.here = [...here, ...answer.edits];
      }
      this.edits = this.here;
    } catch (error) {
      if (connection === this.connection) this.again(error);
    } finally {
      if (connection === this.connection) this.loading = false;
    }
    if (this.isWhole) this.events.changed();
  }

  /** Loads once more after a while; only the first failure of a row is news. */
  private again(error: unknown): void {
    if (this.failures === 0) this.events.trouble(`The edits of the shape could not be loaded: ${error instanceof Error ? error.message : String(error)}.`);
    this.wait(backOff(this.failures++, this.surroundings.random()));
  }

  /** Waits so many milliseconds before loading goes on; null for not at all. */
  private wait(milliseconds: number | null): void {
    if (this.timer !== null) this.surroundings.clearTimer(this.timer);
    this.timer = milliseconds === null ? null : this.surroundings.setTimer(() => {
      this.timer = null;
      void this.load();
    }, milliseconds);
  }
}
