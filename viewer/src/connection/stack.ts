/** The stack of edits: the server says how many there are, and those that are not here yet are fetched. */
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

export class Stack {
  /** The edits of the shape when all of them were here last, the oldest first; a new array for each change. */
  edits: Json[] = [];
  /** Those that are here of the edits of now. */
  private here: Json[] = [];
  /** What the server has said last. */
  told: StackInformation = { revision: -1, edits: 0 };
  private connection = 0;
  private loading = false;

  /** `changed` is called when all edits are here. */
  constructor(
    private readonly address: string, private readonly changed: () => void, private readonly trouble: (text: string) => void,
    private readonly ask: FetchEdits = fetchEdits,
  ) {}

  /** What the first message of a connection says: it may be another run. */
  begin(told: StackInformation): void {
    this.connection++;
    this.loading = false;
    this.here = [];
    this.told = told;
    void this.load();
  }

  /** The stack has changed: all but the first `kept` edits. */
  change(told: StackInformation): void {
    if (told.revision <= this.told.revision) return;
    this.told = told;
    this.here = this.here.slice(0, told.kept ?? 0);
    void this.load();
  }

  private async load(): Promise<void> {
    if (this.loading) return;
    this.loading = true;
    const connection = this.connection;
    try {
      while (this.here.length < this.told.edits) {
        const answer = await this.ask(`${this.address}?from=${this.here.length}&revision=${this.told.revision}`);
        if (connection !== this.connection) return;
        // The message that says what has changed is still on its way; it loads the rest.
        if (answer.revision > this.told.revision) return;
        if (answer.revision < this.told.revision) continue;
        if (answer.edits.length === 0) throw new Error("the server has fewer edits than it says");
        this.here = [...this.here, ...answer.edits];
      }
      this.edits = this.here;
      this.changed();
    } catch (error) {
      if (connection === this.connection) this.trouble(`The edits of the shape could not be loaded: ${error instanceof Error ? error.message : String(error)}.`);
    } finally {
      if (connection === this.connection) this.loading = false;
    }
  }
}
