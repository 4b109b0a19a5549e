/** Which values the two ends of a colour map stand for. */
import { digits, within } from "../number";

export type Range = [number, number];
export type RangeKind = "auto" | "over time" | "fixed";

/** How the range of a view is found. `low` and `high` count where it is fixed. */
export interface RangeChoice { kind: RangeKind; low: number; high: number; symmetric: boolean; logarithmic: boolean }

/** A logarithmic map shows no more powers of ten than these below the largest value. */
const DECADES = 6;

const union = (a: Range | null, b: Range | null): Range | null => (a && b ? [Math.min(a[0], b[0]), Math.max(a[1], b[1])] : a ?? b);

/** A view that is coloured: its name, a key that names it and what of its field, the range of its values now, and whether it is seen. */
export interface Coloured { view: string; key: string; now: Range | null; isSeen: boolean }

/** Remembers what was, for each view and field, so that colours can stay the same from frame to frame. */
export class Ranges {
  /** Automatic ranges, as they were shown last. */
  private readonly shown = new Map<string, Range>();
  /** All values so far of what has had colours, whatever range was wanted then. */
  private readonly ever = new Map<string, { view: string; range: Range }>();

  /**
   * The range to show for views that have their colours in common; null for none. While `held`, an automatic range stays as it was: the
   * picture of a shape that is under way can then be compared with the one before. What was over time counts also where it is not seen now.
   */
  range(views: readonly Coloured[], choice: RangeChoice, held: boolean): Range | null {
    const seen = views.filter(({ isSeen }) => isSeen);
    const now = seen.reduce<Range | null>((all, view) => union(all, view.now), null);
    for (const { view, key, now: range } of views) {
      const all = union(this.ever.get(key)?.range ?? null, range);
      if (all) this.ever.set(key, { view, range: all });
    }
    if (choice.kind === "fixed") return choice.low < choice.high ? fixed(choice) : now && spread(now, choice);
    if (choice.kind === "over time") {
      const found = views.reduce<Range | null>((all, { key }) => union(all, this.ever.get(key)?.range ?? null), null);
      return found && spread(found, choice);
    }
    const found = (held ? seen.reduce<Range | null>((all, { key }) => union(all, this.shown.get(key) ?? null), null) : null) ?? now;
    if (!found) return null;
    for (const { key } of seen) this.shown.set(key, found);
    return spread(found, choice);
  }

  /** Forgets what is no longer shown, and all that was of views that are no longer there. */
  keep(keys: ReadonlySet<string>, views: ReadonlySet<string>): void {
    for (const key of this.shown.keys()) if (!keys.has(key)) this.shown.delete(key);
    for (const [key, { view }] of this.ever) if (!views.has(view)) this.ever.delete(key);
  }

  /** Forgets everything: time begins anew. */
  clear(): void {
    this.shown.clear();
    this.ever.clear();
  }
}

/** What a range of no width is made to have, in parts of its value. */
const SPREAD = 1e-6;

/** Whether a range is of one value: its ends differ for the sake of the colours alone. */
export const isOfOneValue = ([low, high]: Range): boolean => low !== 0 && Math.abs((high - low) / (SPREAD * Math.abs(low)) - 1) < 1e-6;

/** A value of a range, with the digits that tell it from others there; where all are one, with few. */
export function textIn(value: number, range: Range, logarithmic: boolean): string {
  return isOfOneValue(range) ? digits(value) : within(value, logarithmic ? [0, value] : range);
}

/** The choice with a range that somebody has typed, which is kept as it is: it need not lie about 0. */
export const withTyped = (choice: RangeChoice, [low, high]: Range): RangeChoice => ({ ...choice, kind: "fixed", low, high, symmetric: false });

/** Why numbers are no ends of a range, in words for each of the two; empty where they are. */
export function whyNoEnds([low, high]: readonly [number, number], logarithmic: boolean): [string, string] {
  const [ofLow, ofHigh] = [low, high].map((end) => (logarithmic && end <= 0 ? "a logarithmic range holds only numbers above 0" : ""));
  return [ofLow!, ofHigh! || (high <= low ? "must be more than the lowest value" : "")];
}

/** The least range about 0 that holds another. */
export function about0([low, high]: Range): Range {
  const most = Math.max(Math.abs(low), Math.abs(high)) || 1e-12;
  return [-most, most];
}

/** The range between ends that were typed, as far as the map can show it. */
function fixed({ low, high, ...choice }: RangeChoice): Range {
  return choice.logarithmic && low > 0 ? [low, high] : spread([low, high], { ...choice, low, high });
}

/** The same range about 0, or of positive values, and never empty. */
function spread([low, high]: Range, { symmetric, logarithmic }: RangeChoice): Range {
  if (logarithmic) {
    const top = high > 0 ? high : 1;
    const bottom = Math.max(low > 0 ? low : 0, top * 10 ** -DECADES);
    return bottom < top ? [bottom, top] : [top / 10, top];
  }
  if (symmetric) return about0([low, high]);
  return high > low ? [low, high] : [low, low + Math.max(Math.abs(low) * SPREAD, 1e-12)];
}

/** The value at a part of the way from the low end to the high one. */
export function onScale([low, high]: Range, part: number, logarithmic: boolean): number {
  return logarithmic ? low * (high / low) ** part : low + (high - low) * part;
}
