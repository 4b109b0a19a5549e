/** Views whose colours stand for the same have one range and one scalar bar. */
import { colourKey } from "../store/looks";
import type { Look } from "../store/looks";
import type { Layer } from "./layer";
import type { Coloured, Range, Ranges } from "./ranges";

/** The colours that some views have in common, the range that they stand for, and whether there is also what is no number. */
export interface Bar { key: string; look: Look; views: string[]; range: Range; hasGaps: boolean }

/** Colours views by what they hold now; returns the bars of what is seen. What is hidden counts only where all that was does. */
export function colour(layers: Iterable<Layer>, ranges: Ranges, held: boolean): Bar[] {
  const groups = new Map<string, { look: Look; members: (Coloured & { layer: Layer })[] }>();
  const remembered = new Set<string>();
  const names = new Set<string>();
  for (const layer of layers) {
    const { look, name } = layer;
    const memory = JSON.stringify([name, look.field, look.component]);
    remembered.add(memory);
    names.add(name);
    const now = look.visible || look.range.kind === "over time" ? layer.takeScalars() : null;
    const key = colourKey(look);
    if (key === null) continue;
    if (!now) {
      // Where no value is a number any range shows that.
      if (look.visible) layer.paint([0, 1]);
      continue;
    }
    const group = groups.get(key) ?? { look, members: [] };
    groups.set(key, group);
    group.members.push({ view: name, key: memory, now, isSeen: look.visible, layer });
  }
  const bars: Bar[] = [];
  for (const [key, { look, members }] of groups) {
    const range = ranges.range(members, look.range, held);
    const seen = members.filter(({ isSeen }) => isSeen);
    if (!range || seen.length === 0) continue;
    for (const { layer } of seen) layer.paint(range);
    bars.push({ key, look, range, views: seen.map(({ layer }) => layer.name), hasGaps: seen.some(({ layer }) => layer.hasGaps) });
  }
  ranges.keep(remembered, names);
  return bars;
}
