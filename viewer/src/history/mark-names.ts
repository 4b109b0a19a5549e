/** Where the names of orders stand in a plot: beside their lines, over one another where they would meet, and none beyond its edge. */

/** A line at `x` and the name that belongs to it, of this width; all in pixels. */
export interface MarkName { x: number; width: number }

/** Where a name begins, in which row it stands, and how wide it may be. */
export interface NamePlace { left: number; row: number; width: number }

/** The least part of a name that is worth to be shown. */
const LEAST = 0.65;

/**
 * The places of the names between two edges, in so many rows; null for one that finds no room. The last have the first choice: of orders
 * the newest says most. A name stands to the right of its line or else to its left, where it is seen whole and crosses no other line if it can.
 */
export function placeNames(marks: readonly MarkName[], [from, to]: readonly [number, number], rows: number, gap: number): (NamePlace | null)[] {
  const places = marks.map((): NamePlace | null => null);
  for (let i = marks.length - 1; i >= 0; i--) {
    const { x, width } = marks[i]!;
    if (x < from || x > to) continue;
    const [right, left] = [Math.min(width, to - x - gap), Math.min(width, x - gap - from)];
    const isFree = ({ row, left: start, width: wide }: NamePlace): boolean =>
      places.every((other) => other?.row !== row || start > other.left + other.width + gap || start + wide + gap < other.left);
    const free = Array.from({ length: rows }, (_, row) => [{ row, left: x + gap, width: right }, { row, left: x - gap - left, width: left }]).flat()
      .filter((place) => place.width >= LEAST * width && isFree(place));
    const cost = ({ left: start, width: wide }: NamePlace): number =>
      marks.filter((other) => other.x > start && other.x < start + wide).length + marks.length * (1 - wide / width);
    const least = Math.min(...free.map(cost));
    places[i] = free.find((place) => cost(place) === least) ?? null;
  }
  return places;
}

/** As much of a text as is no wider than `width`. */
export function shortened(text: string, width: number, measure: (text: string) => number): string {
  if (measure(text) <= width) return text;
  const characters = [...text];
  while (characters.length > 1 && measure(`${characters.join("")}…`) > width) characters.pop();
  return `${characters.join("").trimEnd()}…`;
}
