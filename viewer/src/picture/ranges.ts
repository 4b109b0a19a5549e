/** Which values the two ends of a colour map stand for. */

export type Range = [number, number];
export type RangeKind = "auto" | "over time" | "fixed";

/** How the range of a view is found. `low` and `high` count where it is fixed. */
export interface RangeChoice { kind: RangeKind; low: number; high: number; symmetric: boolean; logarithmic: boolean }

/** A logarithmic map shows no more powers of ten than these below the largest value. */
const DECADES = 6;

const union = (a: Range | null, b: Range | null): Range | null => (a && b ? [Math.min(a[0], b[0]), Math.max(a[1], b[1])] : a ?? b);

/** Remembers what was shown, by a key that names what is coloured, so that colours can stay the same from frame to frame. */
export class Ranges {
  private readonly shown = new Map<string, Range>();

  /**
   * The range to show, of the range of the values that are there; null for none. While `held`, an automatic range stays as it was:
   * the picture of a shape that is under way can then be compared with the one before.
   */
  range(key: string, choice: RangeChoice, now: Range | null, held: boolean): Range | null {
    let found: Range | null;
    if (choice.kind === "fixed") found = choice.low < choice.high ? [choice.low, choice.high] : now;
    else {
      const before = this.shown.get(key) ?? null;
      found = choice.kind === "over time" ? union(before, now) : held && before ? before : now;
      if (found) this.shown.set(key, found);
    }
    return found && spread(found, choice);
  }

  /** Forgets what was shown under keys that are no longer there. */
  keep(keys: ReadonlySet<string>): void {
    for (const key of this.shown.keys()) if (!keys.has(key)) this.shown.delete(key);
  }
}

/** The same range about 0, or of positive values, and never empty. */
function spread([low, high]: Range, { symmetric, logarithmic }: RangeChoice): Range {
  if (logarithmic) {
    const top = high > 0 ? high : 1;
    const bottom = Math.max(low > 0 ? low : 0, top * 10 ** -DECADES);
    return bottom < top ? [bottom, top] : [top / 10, top];
  }
  if (symmetric) {
    const most = Math.max(Math.abs(low), Math.abs(high)) || 1e-12;
    return [-most, most];
  }
  return high > low ? [low, high] : [low, low + Math.max(Math.abs(low) * 1e-6, 1e-12)];
}

/** The value at a part of the way from the low end to the high one. */
export function valueAt([low, high]: Range, part: number, logarithmic: boolean): number {
  return logarithmic ? low * (high / low) ** part : low + (high - low) * part;
}
