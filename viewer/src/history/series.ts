/** What monitors have said over time, within bounds: old values thin out, however long a run lasts. */
import { MESH } from "./mesh-quality";

/** The most times of one source. Where there are more, every other one of the older half is forgotten. */
export const TIMES = 2000;
/** The most values that are kept side by side; later ones are not, unless one of a monitor that is no more makes room. */
export const SERIES = 200;

/** A value at a cycle: null where what was said is no number, undefined where nothing was said. */
export type Said = number | null | undefined;

/** Values that come together, such as those of one pipeline. */
interface Source { cycles: number[]; times: number[]; columns: Map<string, Said[]> }

/** One value over time: its name in the list, and whence it comes. */
export interface Series { key: string; source: string; name: string; unit: string | null }

export class History {
  private readonly sources = new Map<string, Source>();
  private readonly list = new Map<string, Series>();
  /** The monitors that there are, by the keys of their series, and those of before. */
  private monitors: ReadonlySet<string> = new Set();
  private readonly ended = new Set<string>();

  /** The series in the order in which they came up. */
  get series(): Series[] {
    return [...this.list.values()];
  }

  /** Takes values of one cycle. A cycle that was there already, after a connection came back, is passed over; an earlier one begins anew. */
  add(source: string, cycle: number, time: number, values: Record<string, number | null>): void {
    let kept = this.sources.get(source);
    const last = kept?.cycles.at(-1);
    if (last !== undefined && cycle === last) return;
    if (!kept || (last !== undefined && cycle < last)) {
      kept = { cycles: [], times: [], columns: new Map(kept ? [...kept.columns.keys()].map((name) => [name, []]) : []) };
      this.sources.set(source, kept);
    }
    for (const name of Object.keys(values)) {
      if (kept.columns.has(name) || (this.list.size >= SERIES && !this.makeRoom(kept))) continue;
      kept.columns.set(name, new Array<undefined>(kept.cycles.length).fill(undefined));
      const key = seriesKey(source, name);
      this.list.set(key, { key, source, name, unit: this.list.get(key)?.unit ?? null });
    }
    kept.cycles.push(cycle);
    kept.times.push(time);
    for (const [name, column] of kept.columns) {
      const value = values[name];
      column.push(value === undefined || Number.isFinite(value) ? value : null);
    }
    if (kept.cycles.length > TIMES) thin(kept);
  }

  setUnit(source: string, name: string, unit: string | null): void {
    const series = this.list.get(seriesKey(source, name));
    if (series) series.unit = unit;
  }

  /** The series of the monitors that there are now. Those that there were keep theirs for as long as there is room. */
  keep(monitors: readonly string[]): void {
    const now = new Set(monitors);
    for (const key of this.monitors) if (!now.has(key) && this.list.has(key)) this.ended.add(key);
    for (const key of now) this.ended.delete(key);
    this.monitors = now;
  }

  /** Forgets the oldest series of a monitor that is no more; says whether there was one. `taking` is the source that takes its place. */
  private makeRoom(taking: Source): boolean {
    const [key] = this.ended;
    if (key === undefined) return false;
    this.ended.delete(key);
    const series = this.list.get(key);
    if (!series) return this.makeRoom(taking);
    this.list.delete(key);
    const source = this.sources.get(series.source);
    source?.columns.delete(series.name);
    if (source?.columns.size === 0 && source !== taking) this.sources.delete(series.source);
    return true;
  }

  /** Forgets a source, and its series. */
  remove(source: string): void {
    this.sources.delete(source);
    for (const [key, series] of this.list) if (series.source === source) this.list.delete(key);
  }

  /** The cycles of several series together, and what each has said at them. */
  table(keys: readonly string[]): { cycles: number[]; times: number[]; columns: Said[][] } {
    const chosen = keys.flatMap((key) => this.list.get(key) ?? []);
    const used = new Set(chosen.map((series) => series.source));
    const at = new Map<number, number>();
    for (const name of used) {
      const source = this.sources.get(name);
      source?.cycles.forEach((cycle, i) => at.set(cycle, source.times[i]!));
    }
    const cycles = [...at.keys()].sort((a, b) => a - b);
    const rows = new Map(cycles.map((cycle, row) => [cycle, row]));
    const columns = chosen.map((series) => {
      const result = new Array<Said>(cycles.length).fill(undefined);
      const source = this.sources.get(series.source);
      const column = source?.columns.get(series.name);
      source?.cycles.forEach((cycle, i) => { result[rows.get(cycle)!] = column?.[i]; });
      return result;
    });
    return { cycles, times: cycles.map((cycle) => at.get(cycle)!), columns };
  }

  /** What a series has said last at a cycle or before it; null where that was no number, or nothing was said. */
  at(key: string, cycle: number): number | null {
    const series = this.list.get(key);
    const source = series && this.sources.get(series.source);
    const column = series && source?.columns.get(series.name);
    if (!source || !column) return null;
    for (let i = lastAt(source.cycles, cycle); i >= 0; i--) if (column[i] !== undefined) return column[i]!;
    return null;
  }

  /** What is known, to be kept while the page is loaded again, in so many characters at most: old values thin out. Null where there is no room. */
  kept(longest: number): string | null {
    const sources = [...this.sources].map(([name, source]) => ({ name, ...source, columns: new Map(source.columns) }));
    // At first by what a number takes at most, so that not much is written in vain.
    for (let room = longest / LONGEST_NUMBER; thinTo(sources, room); room /= 2) {
      const text = JSON.stringify(sources.map(({ name, cycles, times, columns }): KeptSource => [name, cycles, times, [...columns].map(([of, values]) =>
        [of, this.list.get(seriesKey(name, of))?.unit ?? null, this.isOfMonitor(seriesKey(name, of)), values.map((value) => (value === undefined ? UNSAID : value))])]));
      if (text.length <= longest) return text;
    }
    return null;
  }

  /** Takes what was kept before the page was loaded again; rubbish counts as nothing. */
  restore(text: string): void {
    for (const [source, cycles, times, columns] of readKept(text)) {
      cycles.forEach((cycle, row) => {
        const said = columns.flatMap(([name, , , values]): [string, number | null][] => {
          const value = values[row];
          return value === UNSAID || value === undefined ? [] : [[name, value]];
        });
        this.add(source, cycle, times[row]!, Object.fromEntries(said));
      });
      for (const [name, unit] of columns) this.setUnit(source, name, unit);
      // Those that the run has no more make room for others, as they would have done without the reload.
      const monitors = columns.flatMap(([name, , isOfMonitor]) => (isOfMonitor ? [seriesKey(source, name)] : []));
      this.monitors = new Set([...this.monitors, ...monitors]);
    }
  }

  /** Whether a series is of a monitor, also of one that is no more, and not of a pinned place. */
  private isOfMonitor(key: string): boolean {
    return this.monitors.has(key) || this.ended.has(key);
  }

  /** All that is kept, as comma-separated values: cycle, time, then a column for each series. */
  csv(): string {
    const { series } = this;
    const { cycles, times, columns } = this.table(series.map(({ key }) => key));
    const name = ({ source, name, unit }: Series): string => quoted(`${source}: ${name}${unit ? ` [${unit}]` : ""}`);
    const lines = [["cycle", "time", ...series.map(name)].join(",")];
    cycles.forEach((cycle, row) => lines.push([cycle, times[row], ...columns.map((column) => column[row] ?? "")].join(",")));
    return `${lines.join("\n")}\n`;
  }
}

/** The most characters of a number and what parts it from the next. */
const LONGEST_NUMBER = 20;
/** Stands for what was not said, which JSON does not know. */
const UNSAID = false;

/** A source as it is kept: its name, cycles and times, and for each series name, unit, whether it is of a monitor, and values. */
type KeptSource = [string, number[], number[], [string, string | null, boolean, (number | null | typeof UNSAID)[]][]];

function readKept(text: string): KeptSource[] {
  const isText = (value: unknown): boolean => typeof value === "string";
  const isColumn = (value: unknown, rows: number, check: (value: unknown) => boolean): boolean => Array.isArray(value) && value.length === rows && value.every(check);
  const isSource = (value: unknown): value is KeptSource => {
    const [name, cycles, times, columns] = Array.isArray(value) ? value as unknown[] : [];
    if (!isText(name) || !Array.isArray(cycles) || !Array.isArray(columns)) return false;
    return [cycles, times].every((column) => isColumn(column, cycles.length, Number.isFinite)) && columns.every((column) => {
      const [of, unit, isOfMonitor, values] = Array.isArray(column) ? column as unknown[] : [];
      return isText(of) && (unit === null || isText(unit)) && typeof isOfMonitor === "boolean" && isColumn(values, cycles.length, (said) => said === null || said === UNSAID || Number.isFinite(said));
    });
  };
  try {
    const read: unknown = JSON.parse(text);
    return Array.isArray(read) ? read.filter(isSource) : [];
  } catch {
    return [];
  }
}

export const seriesKey = (source: string, name: string): string => `${source}\u0000${name}`;

/** Whether times are those of a run, which rise with its cycles, and do not only stand in for them. */
export function areTold(cycles: readonly number[], times: readonly number[]): boolean {
  return times.some((time, row) => time !== cycles[row]) && times.every((time, row) => row === 0 || time > times[row - 1]!);
}

/** What stands in one rising list beside a value of another: between two of them in the same proportion. */
export function interpolated(of: readonly number[], beside: readonly number[], value: number): number {
  const row = Math.min(Math.max(lastAt(of, value), 0), Math.max(0, of.length - 2));
  const [a, b, c, d] = [of[row], of[row + 1], beside[row], beside[row + 1]];
  if (a === undefined || c === undefined) return value;
  return b === undefined || d === undefined || b === a ? c : c + ((value - a) * (d - c)) / (b - a);
}

/** The last index whose cycle is not beyond one; -1 where all are. */
export function lastAt(cycles: readonly number[], cycle: number): number {
  let low = 0, high = cycles.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (cycles[middle]! <= cycle) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function thin(source: Source): void {
  const half = source.cycles.length >> 1;
  const keep = <T>(list: T[]): T[] => list.filter((_, i) => i >= half || i % 2 === 0);
  source.cycles = keep(source.cycles);
  source.times = keep(source.times);
  for (const [name, column] of source.columns) source.columns.set(name, keep(column));
}

/** Thins sources out, the largest first, until they have no more than so many numbers; says whether that could be done. */
function thinTo(sources: readonly Source[], most: number): boolean {
  const size = ({ cycles, columns }: Source): number => cycles.length * (columns.size + 2);
  let total = sources.reduce((sum, source) => sum + size(source), 0);
  while (total > most) {
    const largest = sources.reduce((a, b) => (size(b) > size(a) ? b : a));
    const before = size(largest);
    thin(largest);
    if (size(largest) === before) return false;
    total += size(largest) - before;
  }
  return true;
}

// A text that a spreadsheet would take for a formula is not made by a solver's names.
const quoted = (text: string): string => (/[",\n\r]/.test(text) || /^[=+\-@]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** An order in the plot: where the shape began to change. */
export interface Mark { cycle: number; label: string }

/** A value at a cycle, and what it was before the last order that came before it. */
export interface Comparison { value: number | null; order: Mark | null; before: number | null; difference: number | null }

export function compare(history: History, key: string, cycle: number, marks: readonly Mark[]): Comparison {
  const value = history.at(key, cycle);
  const order = marks.reduce<Mark | null>((last, mark) => (mark.cycle <= cycle && (!last || mark.cycle >= last.cycle) ? mark : last), null);
  // What was measured at the cycle of the order was measured before the shape changed.
  const before = order ? history.at(key, order.cycle) : null;
  return { value, order, before, difference: value !== null && before !== null ? difference(value, before) : null };
}

/** The part of a value below which a difference is what rounding has left. */
const ROUNDING = 1e-9;

function difference(value: number, before: number): number {
  return Math.abs(value - before) <= ROUNDING * Math.max(Math.abs(value), Math.abs(before)) ? 0 : value - before;
}

/** What a person who asks for nothing wants to see: the pressure, what goes in and out, and the quality of the mesh; at most three. */
export function firstChoice(series: readonly Series[]): string[] {
  // Of the patterns for one thing the first that any of them meets.
  const wanted = [[/quality\.min$/], [/drop/, /pressure/], [/mass|flux|balance/]];
  const ofMonitors = series.filter(({ source }) => source !== MESH);
  // What a monitor measures comes before what the run tells without one.
  const all = [...ofMonitors, ...series.filter(({ source }) => source === MESH)];
  const met = (pattern: RegExp): Series | undefined => all.find(({ source, name }) => pattern.test(name) || (pattern.test(source) && !/quality/.test(name)));
  const found = wanted.flatMap((patterns) => patterns.map(met).find((one) => one !== undefined) ?? []);
  const isOfMonitor = found.some(({ source }) => source !== MESH);
  const keys = new Set([...found, ...(isOfMonitor ? [] : ofMonitors.slice(0, 2))].map(({ key }) => key));
  return [...keys];
}
