/** How numbers are written: with the digits that matter and no more. */

/** A number with `digits` significant digits, plain where that is readable and in powers of ten where it is not. */
export function digits(value: number | null | undefined, count = 4): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const long = size >= 10 ** count;
  const text = (long && size >= 1e5) || size < 1e-3 ? value.toExponential(Math.max(1, count - 2)) : long ? String(Math.round(value)) : value.toPrecision(count);
  const [mantissa, power] = text.split("e") as [string, string?];
  const short = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  return (power === undefined ? short : `${short}e${power.replace("+", "")}`).replace("-", "−").replace("e-", "e−");
}

/** A number of a range, with the digits that tell it from its neighbours in that range. */
export function within(value: number, range: readonly [number, number]): string {
  const width = Math.abs(range[1] - range[0]);
  if (!(width > 0) || !Number.isFinite(width)) return digits(value);
  const quantum = 10 ** (Math.floor(Math.log10(width)) - 3);
  return digits(Math.round(value / quantum) * quantum || 0, Math.max(4, Math.min(12, Math.ceil(Math.log10(Math.abs(value) / width || 1)) + 4)));
}

/** The fewest characters in which there is room for any number. */
const LEAST_ROOM = 7;

/** A number in so many characters: all of it where they suffice, else with as many of its digits as they do for, and its power of ten. */
export function fitting(value: number, room: number): string {
  const whole = String(value);
  if (whole.length <= room || !Number.isFinite(value)) return whole;
  for (let count = room; count > 1; count--) {
    const rounded = Number(value.toPrecision(count));
    const found = [String(rounded), rounded.toExponential().replace("e+", "e")].find((text) => text.length <= Math.max(room, LEAST_ROOM));
    if (found !== undefined) return found;
  }
  return Number(value.toPrecision(1)).toExponential().replace("e+", "e");
}

/** What a number of a model is rounded to, in parts of its size: finer than anybody points, and coarser than what rounding leaves. */
const POINTED = 1e-6;

/** A place that somebody has pointed at, in a box of this size (its diagonal) or larger, without what rounding has left in its digits. */
export function pointed(place: readonly [number, number, number], size: number): [number, number, number] {
  if (!(size > 0) || !Number.isFinite(size)) return [...place];
  const power = Math.floor(Math.log10(size * POINTED));
  return place.map((part) => (power >= 0 ? Math.round(part / 10 ** power) * 10 ** power : Number(part.toFixed(Math.min(100, -power)))) + 0) as [number, number, number];
}

/** Seconds in the unit that suits them. */
export function seconds(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value < 1e-3) return `${digits(value * 1e6, 3)}\u00a0µs`;
  if (value < 1) return `${digits(value * 1e3, 3)}\u00a0ms`;
  if (value < 120) return `${digits(value, 3)}\u00a0s`;
  return `${digits(value / 60, 3)}\u00a0min`;
}

/** Digits in threes: with a comma for the decimal point by some, for the thousands by others. A number of thousands does not begin with a zero. */
const THREES = /^[+-]?[1-9]\d{0,2}(,\d{3})+$/;

const plain = (text: string): string => text.trim().replaceAll("−", "-");

/** Reads a number as a person writes one, with a point or a comma; null when it is none, or could be two. */
export function readNumber(text: string): number | null {
  const typed = plain(text);
  const pointed = typed.replace(",", ".");
  if (THREES.test(typed) || !/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(pointed)) return null;
  const value = Number(pointed);
  return Number.isFinite(value) ? value : null;
}

/** Why a text is no number, in words that follow its name; empty where it is one. */
export function whyNoNumber(text: string): string {
  if (readNumber(text) !== null) return "";
  if (text.trim() === "") return "is empty";
  const typed = plain(text);
  if (!THREES.test(typed)) return `“${text}” is not a number`;
  const [whole, parts] = [typed.replaceAll(",", ""), typed.split(",").length];
  return parts > 2 ? `“${text}” has commas: write ${whole}` : `“${text}” can be read in two ways: write ${whole} or ${Number(typed.replace(",", "."))}`;
}

/** A name from the JSON as words: `harmonic_order` is "harmonic order". */
export const words = (name: string): string => name.replaceAll("_", " ");
