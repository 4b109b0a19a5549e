/** How numbers are written: with the digits that matter and no more. */

/** A number with `digits` significant digits, plain where that is readable and in powers of ten where it is not. */
export function digits(value: number | null | undefined, count = 4): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(Math.max(0, count - 2)) : value.toPrecision(count);
  const [mantissa, power] = (text.includes("e") ? text : size >= 10 ** count ? String(Math.round(value)) : text).split("e") as [string, string?];
  const short = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  return (power === undefined ? short : `${short}e${power.replace("+", "")}`).replace("-", "−").replace("e-", "e−");
}

/** Seconds in the unit that suits them. */
export function seconds(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value < 1e-3) return `${digits(value * 1e6, 3)} µs`;
  if (value < 1) return `${digits(value * 1e3, 3)} ms`;
  if (value < 120) return `${digits(value, 3)} s`;
  return `${digits(value / 60, 3)} min`;
}

/** Reads a number as a person writes one; null when it is none. */
export function readNumber(text: string): number | null {
  const plain = text.trim().replace("−", "-").replace(",", ".");
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain)) return null;
  const value = Number(plain);
  return Number.isFinite(value) ? value : null;
}

/** A name from the JSON as words: `harmonic_order` is "harmonic order". */
export const words = (name: string): string => name.replaceAll("_", " ");
