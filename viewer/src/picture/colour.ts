/** Colour maps, and the scalars that a field is coloured by. */
import maps from "../../../pipelines/src/render/colour-maps.json";
import type { DataArray } from "../connection/protocol";

export type Colour = [number, number, number];
export interface ColourMap { name: string; title: string; kind: string; stops: Colour[] }

const rgb = (text: string): Colour => {
  const value = parseInt(text, 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
};

/** Evenly spaced stops; the list is that of the pictures that a run writes (`pipelines/src/render/colour.rs` says whose the maps are). */
export const COLOUR_MAPS: readonly ColourMap[] = maps.map(({ name, title, kind, colors }) => ({ name, title, kind, stops: colors.map(rgb) }));

export const colourMap = (name: string): ColourMap => COLOUR_MAPS.find((map) => map.name === name) ?? COLOUR_MAPS[0]!;

export const gradient = (map: ColourMap, direction: string): string =>
  `linear-gradient(${direction}, ${map.stops.map((stop) => `rgb(${stop.map((x) => Math.round(x * 255)).join(" ")})`).join(", ")})`;

/**
 * The scalars of a field, one per point or element: the magnitude of a vector, or one of its components. `room` is where those of a vector
 * are written, if they are as many.
 */
export function scalars(field: DataArray, component: number, room?: Float64Array): Float64Array {
  const { components, values } = field;
  if (components === 1) return values;
  const count = values.length / components;
  const result = room?.length === count ? room : new Float64Array(count);
  for (let i = 0; i < count; i++) {
    if (component >= 0) {
      result[i] = values[i * components + Math.min(component, components - 1)]!;
    } else {
      let sum = 0;
      for (let c = 0; c < components; c++) sum += values[i * components + c]! ** 2;
      result[i] = Math.sqrt(sum);
    }
  }
  return result;
}

/**
 * Where values lie between the ends of a range: 0 at the low end, 1 at the high one, NaN where there is no number. With logarithms nothing
 * lies below the low end: between a zero and its neighbour a colour would otherwise hardly be seen.
 */
export function mapped(values: Float64Array, [low, high]: readonly [number, number], logarithmic: boolean, into: Float32Array = new Float32Array(values.length)): Float32Array {
  const origin = logarithmic ? Math.log10(low) : low;
  const part = 1 / ((logarithmic ? Math.log10(high) : high) - origin);
  if (!logarithmic) for (let i = 0; i < values.length; i++) into[i] = (values[i]! - origin) * part;
  else for (let i = 0; i < values.length; i++) into[i] = Number.isNaN(values[i]) ? NaN : (Math.log10(Math.max(values[i]!, low)) - origin) * part;
  return into;
}

/** The grey, between 0 and 1, of what is no number, as in the pictures that a run writes. */
export const NO_NUMBER = 0.5;
/** The grey of what is no number, for the page; and its name. */
export const GREY = `rgb(${Array(3).fill(Math.round(255 * NO_NUMBER)).join(" ")})`;
export const NO_NUMBER_TEXT = "no number";

/** Smallest and largest finite value, null when there is none; and whether some value is no number. Nothing is made for each value. */
export function extremes(values: Float64Array): { range: [number, number] | null; hasGaps: boolean } {
  let low = Infinity, high = -Infinity, hasGaps = false;
  for (let i = 0; i < values.length; i++) {
    const value = values[i]!;
    if (value < low && value !== -Infinity) low = value;
    if (value > high && value !== Infinity) high = value;
    if (Number.isNaN(value)) hasGaps = true;
  }
  return { range: low <= high ? [low, high] : null, hasGaps };
}

/** The names of a field's components. */
export function componentNames(components: number): string[] {
  if (components <= 3) return ["x", "y", "z"].slice(0, components);
  if (components === 6) return ["xx", "yy", "zz", "xy", "yz", "xz"];
  return Array.from({ length: components }, (_, i) => String(i));
}
