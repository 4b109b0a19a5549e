/** The name that was likely meant, by the same rule as the run's (`deform/src/names.rs`). */

/** Longer names are near none: to measure them would cost the square of their length. */
const LONGEST = 200;

/** How many letters must be put in, taken out, changed, or exchanged with the next to come from one word to another. */
function distance(from: string, to: string): number {
  let [beforeLast, last]: [number[], number[]] = [[], Array.from({ length: to.length + 1 }, (_, i) => i)];
  for (let i = 1; i <= from.length; i++) {
    const row = [i];
    for (let j = 1; j <= to.length; j++) {
      const change = last[j - 1]! + (from[i - 1] === to[j - 1] ? 0 : 1);
      row[j] = Math.min(last[j]! + 1, row[j - 1]! + 1, change);
      if (i > 1 && j > 1 && from[i - 1] === to[j - 2] && from[i - 2] === to[j - 1]) row[j] = Math.min(row[j]!, beforeLast[j - 2]! + 1);
    }
    [beforeLast, last] = [last, row];
  }
  return last[to.length]!;
}

const plain = (name: string): string => name.toLowerCase().replace(/[- ]/g, "_");

/** The known name that differs the least, by two letters in five at most, or that begins as a name does; null for none. */
export function nearest(name: string, known: readonly string[]): string | null {
  if (name.length > LONGEST) return null;
  const wanted = plain(name);
  const slips = Math.max(1, Math.floor((wanted.length * 2) / 5));
  let best: { candidate: string; slips: number } | null = null;
  for (const candidate of known) {
    const found = distance(wanted, plain(candidate));
    const isNear = found <= slips || (wanted.length >= 4 && plain(candidate).startsWith(wanted));
    if (isNear && (best === null || found < best.slips)) best = { candidate, slips: found };
  }
  return best?.candidate ?? null;
}

/** The most names that are listed where none is near. */
const LISTED = 8;

/** The names that there are, in words. */
export const listed = (known: readonly string[]): string =>
  known.slice(0, LISTED).join(", ") + (known.length > LISTED ? ` and ${known.length - LISTED} more` : "");
