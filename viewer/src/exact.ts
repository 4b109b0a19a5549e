/** An input in which a number stands with fewer digits than it has. As long as nobody touches the text, it stands for the number, to the last bit. */
import { fitting } from "./number";

export interface ExactCell {
  /** The number that was written; null where another text stands there now, or none was written. */
  untouched(): number | null;
  /** The number with all its digits where it is shown with fewer, for the hint of the input; empty otherwise. */
  whole(): string;
  /** Shows a number as a text of the caller's own; or in so many characters, and all of it as the hint of the input. Null for one that is no number. */
  write(value: number | null, shown: string | number): void;
}

export function exactCell(input: HTMLInputElement): ExactCell {
  let written: { text: string; value: number } | null = null;
  const untouched = (): number | null => (written !== null && input.value === written.text ? written.value : null);
  const whole = (): string => {
    const value = untouched();
    return value === null || Number(input.value) === value ? "" : String(value);
  };
  return {
    untouched, whole,
    write: (value, shown) => {
      input.value = typeof shown === "string" ? shown : value === null ? "" : fitting(value, shown);
      written = value === null ? null : { text: input.value, value };
      if (typeof shown === "number") input.title = whole();
    },
  };
}
