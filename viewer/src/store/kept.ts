/** What the page keeps over a reload: how views look, the dock, the theme, whether the tour was seen, the person's name. Nothing of the run, and no secret. */
import type { Theme } from "../picture/theme";
import { readLooks } from "./looks";
import type { Looks } from "./looks";

const KEY = "tombolo-page";
/** Longer than anything that the page writes. */
const LONGEST = 100_000;
/** The most characters of a name. */
export const LONGEST_NAME = 40;

/** The dock: whether it is open, and which monitors are plotted; null for those of the beginning. */
export interface DockState { open: boolean; chosen: readonly string[] | null }

interface Content { looks: Looks; dock: DockState; theme: Theme | null; toured: boolean; name: string }

export class Kept {
  private readonly content: Content;

  constructor(private readonly storage: Pick<Storage, "getItem" | "setItem">) {
    this.content = read(storage);
  }

  get looks(): Looks { return this.content.looks; }
  set looks(looks: Looks) { this.keep("looks", looks); }
  get dock(): DockState { return this.content.dock; }
  set dock(dock: DockState) { this.keep("dock", dock); }
  /** The theme that was chosen here; null for that of the system. */
  get theme(): Theme | null { return this.content.theme; }
  set theme(theme: Theme | null) { this.keep("theme", theme); }

  /** Whether the tour was seen or left. */
  get toured(): boolean { return this.content.toured; }
  set toured(toured: boolean) { this.keep("toured", toured); }

  /** How the person at this browser is called; empty where nobody has said. */
  get name(): string { return this.content.name; }
  set name(name: string) { this.keep("name", name); }

  private keep<K extends keyof Content>(key: K, value: Content[K]): void {
    this.content[key] = value;
    try {
      this.storage.setItem(KEY, JSON.stringify(this.content));
    } catch {
      // A browser that keeps nothing, or is full: the page works all the same.
    }
  }
}

/** Rubbish, or what another version has written, counts as nothing. */
function read(storage: Pick<Storage, "getItem">): Content {
  let found: Partial<Record<keyof Content, unknown>> = {};
  try {
    const text = storage.getItem(KEY) ?? "";
    const parsed: unknown = text.length > LONGEST ? null : JSON.parse(text || "null");
    if (typeof parsed === "object" && parsed !== null) found = parsed;
  } catch {
    // As above.
  }
  const { open, chosen } = (typeof found.dock === "object" && found.dock !== null ? found.dock : {}) as { open?: unknown; chosen?: unknown };
  const names = Array.isArray(chosen) && chosen.every((key) => typeof key === "string") ? (chosen as string[]) : null;
  return {
    looks: readLooks(found.looks), dock: { open: open !== false, chosen: names },
    theme: found.theme === "dark" || found.theme === "light" ? found.theme : null, toured: found.toured === true,
    name: typeof found.name === "string" ? found.name.slice(0, LONGEST_NAME) : "",
  };
}
