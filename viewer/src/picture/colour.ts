/** Colour maps, and the scalars that a field is coloured by. */
import type { DataArray } from "../connection/protocol";

export type Colour = [number, number, number];
export interface ColourMap { name: string; title: string; stops: Colour[] }

const hex = (text: string): Colour[] => text.split(" ").map((stop) => {
  const value = parseInt(stop, 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
});

/** Evenly spaced stops; viridis and inferno are the maps of matplotlib, cool to warm is that of Moreland (2009). */
export const COLOUR_MAPS: readonly ColourMap[] = [
  { name: "viridis", title: "Viridis", stops: hex("440154 482475 414487 355f8d 2a788e 21918c 22a884 44bf70 7ad151 bddf26 fde725") },
  { name: "inferno", title: "Inferno", stops: hex("000004 160b39 420a68 6a176e 932667 bc3754 dd513a f37819 fca50a f6d746 fcffa4") },
  { name: "coolwarm", title: "Cool to warm", stops: hex("3b4cc0 5977e3 7b9ff9 9ebeff c0d4f5 dddcdc f2cbb7 f7ac8e ee8468 d65244 b40426") },
  { name: "turbo", title: "Turbo", stops: hex("30123b 4145ab 4675ed 39a2fc 1bcfd4 24eca6 61fc6c a4fc3b d1e834 f3c63a fe9b2d f36315 d93806 b11901 7a0402") },
  { name: "grey", title: "Grey", stops: hex("1a1a1a f5f5f5") },
];

export const colourMap = (name: string): ColourMap => COLOUR_MAPS.find((map) => map.name === name) ?? COLOUR_MAPS[0]!;

export const gradient = (map: ColourMap, direction: string): string =>
  `linear-gradient(${direction}, ${map.stops.map((stop) => `rgb(${stop.map((x) => Math.round(x * 255)).join(" ")})`).join(", ")})`;

/** What to colour by: a field, and its magnitude (-1) or one of its components. */
export interface Colouring { field: string; component: number }

/** The scalars of a field, one per point or element: the magnitude of a vector, or one of its components. */
export function scalars(field: DataArray, component: number): Float32Array {
  const { components, values } = field;
  if (components === 1) return values;
  const count = values.length / components;
  const result = new Float32Array(count);
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

/** Smallest and largest finite value; null when there is none. */
export function extremes(values: Float32Array): [number, number] | null {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low && value !== -Infinity) low = value;
    if (value > high && value !== Infinity) high = value;
  }
  return low <= high ? [low, high] : null;
}

/** The names of a field's components. */
export function componentNames(components: number): string[] {
  if (components <= 3) return ["x", "y", "z"].slice(0, components);
  if (components === 6) return ["xx", "yy", "zz", "xy", "yz", "xz"];
  return Array.from({ length: components }, (_, i) => String(i));
}
