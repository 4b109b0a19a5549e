/**
 * What the page keeps over a reload: the theme, whether the tour was seen, the person's name; and for each run of a relay by itself how views
 * look, and the dock. Of the run itself only pins, what monitors have said, whether this page has had the worst cells shown, how the page
 * stands, what stands in its form and which refusals were dismissed, no longer than the session; no secret.
 */
import type { Theme } from "../picture/theme";
import type { Vector } from "../connection/protocol";
import type { Stand } from "../picture/camera";
import { isSound } from "../picture/following";
import { PINS } from "../picture/pins";
import type { KeptPin } from "../picture/pins";
import { readDraft } from "./kept-draft";
import type { KeptForm } from "./kept-draft";
import { readLooks } from "./looks";
import type { Looks } from "./looks";
import { ORDERS } from "./orders";
import { RUN, writeForRun } from "./session";
import type { SessionStore } from "./session";

const KEY = "tombolo-page";
/** Longer than anything that the page writes for longer than its session. */
const LONGEST = 200_000;
/** The most characters of a name. */
export const LONGEST_NAME = 40;

/** The dock: whether it is open, and which monitors are plotted; null for those of the beginning. */
export interface DockState { open: boolean; chosen: readonly string[] | null }

/** For all runs. */
interface Page { theme: Theme | null; toured: boolean; name: string }
/** For the run at one path. */
interface Run { looks: Looks; dock: DockState }

export class Kept {
  private readonly content: Page;
  private readonly run: Run;
  private readonly runKey: string;

  /** `path` tells the runs of a relay from each other. */
  constructor(private readonly storage: Pick<Storage, "getItem" | "setItem">, path: string) {
    this.runKey = `${KEY} ${path}`;
    this.content = readPage(storage);
    this.run = readRun(storage, this.runKey);
  }

  get looks(): Looks { return this.run.looks; }
  set looks(looks: Looks) { this.keepRun("looks", looks); }
  get dock(): DockState { return this.run.dock; }
  set dock(dock: DockState) { this.keepRun("dock", dock); }
  /** The theme that was chosen here; null for that of the system. */
  get theme(): Theme | null { return this.content.theme; }
  set theme(theme: Theme | null) { this.keep("theme", theme); }

  /** Whether the tour was seen or left. */
  get toured(): boolean { return this.content.toured; }
  set toured(toured: boolean) { this.keep("toured", toured); }

  /** How the person at this browser is called; empty where nobody has said. */
  get name(): string { return this.content.name; }
  set name(name: string) { this.keep("name", name); }

  private keep<K extends keyof Page>(key: K, value: Page[K]): void {
    this.content[key] = value;
    this.store(KEY, this.content);
  }

  private keepRun<K extends keyof Run>(key: K, value: Run[K]): void {
    this.run[key] = value;
    this.store(this.runKey, this.run);
  }

  private store(key: string, content: Page | Run): void {
    try {
      this.storage.setItem(key, JSON.stringify(content));
    } catch {
      // A browser that keeps nothing, or is full: the page works all the same.
    }
  }
}

/**
 * What is kept of a run: the pins, what monitors have said, null for nothing, and whether the pipeline of the worst cells is of this page;
 * how the page stood, what stood in its form, and which orders were taken off the list of what was refused.
 */
export interface KeptOfRun {
  pins: readonly KeptPin[]; history: string | null; isWorstOwn: boolean;
  /** Where somebody has put the camera; null where it shows the whole. */
  camera: Stand | null;
  isParallel: boolean; isSkeletonShown: boolean; isCompared: boolean;
  chosenView: string | null;
  draft: KeptForm | null;
  dismissed: readonly string[];
}

/** The most characters of what monitors have said. */
export const LONGEST_HISTORY = 300_000;
/** The most characters of the id of an order that was dismissed: programs give ids too. */
export const LONGEST_ORDER = 200;

/**
 * What this page keeps of one run while it is loaded again, and no longer. It is for the storage of the session, which is that of one page.
 */
export class KeptRun {
  private readonly key: string;

  /** `path` tells the runs of a relay from each other. */
  constructor(private readonly storage: SessionStore, private readonly path: string) {
    this.key = RUN + path;
  }

  keep(kept: KeptOfRun): void {
    // Nothing old is left, which would be taken for what was said last.
    if (!writeForRun(this.storage, this.path, { [this.key]: JSON.stringify(kept) })) this.forget();
  }

  read(): KeptOfRun {
    // A text in a text is longer than it is: its quotes are escaped.
    const { pins, history, isWorstOwn, camera, isParallel, isSkeletonShown, isCompared, chosenView, draft, dismissed } = read(this.storage, this.key, 2 * (LONGEST_HISTORY + LONGEST + ORDERS * LONGEST_ORDER));
    return {
      pins: Array.isArray(pins) ? pins.filter(isPin).slice(0, PINS) : [], history: typeof history === "string" ? history : null,
      isWorstOwn: isWorstOwn === true, camera: isStand(camera) ? camera : null, isParallel: isParallel === true,
      isSkeletonShown: isSkeletonShown === true, isCompared: isCompared === true,
      chosenView: typeof chosenView === "string" ? chosenView : null, draft: readDraft(draft),
      dismissed: Array.isArray(dismissed) ? dismissed.filter((id) => typeof id === "string" && id.length <= LONGEST_ORDER).slice(-ORDERS) : [],
    };
  }

  /** It was of another run. */
  forget(): void {
    this.storage.removeItem(this.key);
  }
}

function isPin(value: unknown): value is KeptPin {
  const { name, view, point } = (typeof value === "object" && value !== null ? value : {}) as Partial<Record<keyof KeptPin, unknown>>;
  const isPoint = Array.isArray(point) && point.length === 3 && (point as Vector).every(Number.isFinite);
  return typeof name === "string" && /^probe \d{1,9}$/.test(name) && typeof view === "string" && isPoint;
}

function isStand(value: unknown): value is Stand {
  if (typeof value !== "object" || value === null) return false;
  const { middle, parallel } = value as Partial<Stand>;
  return isSound(value as Stand) && typeof parallel === "boolean" && (middle === undefined || (Array.isArray(middle) && middle.length === 2 && middle.every(Number.isFinite)));
}

/** Rubbish, or what another version has written, counts as nothing. */
function read(storage: Pick<Storage, "getItem">, key: string, longest = LONGEST): { readonly [key: string]: unknown } {
  try {
    const text = storage.getItem(key) ?? "";
    const parsed: unknown = text.length > longest ? null : JSON.parse(text || "null");
    if (typeof parsed === "object" && parsed !== null) return { ...parsed };
  } catch {
    // As above.
  }
  return {};
}

function readPage(storage: Pick<Storage, "getItem">): Page {
  const { theme, toured, name } = read(storage, KEY);
  return { theme: theme === "dark" || theme === "light" ? theme : null, toured: toured === true, name: typeof name === "string" ? name.slice(0, LONGEST_NAME) : "" };
}

function readRun(storage: Pick<Storage, "getItem">, key: string): Run {
  const { looks, dock } = read(storage, key);
  const { open, chosen } = (typeof dock === "object" && dock !== null ? dock : {}) as { open?: unknown; chosen?: unknown };
  const names = Array.isArray(chosen) && chosen.every((name) => typeof name === "string") ? chosen : null;
  return { looks: readLooks(looks), dock: { open: open !== false, chosen: names } };
}
