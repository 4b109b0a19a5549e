/** An input in which a number stands with fewer digits than it has. As long as nobody touches the text, it stands for the number, to the last bit. */
export interface ExactCell {
  /** The number that was written; null where another text stands there now, or none was written. */
  untouched(): number | null;
  /** Shows a number as a text; null for one that is no number. */
  write(value: number | null, text: string): void;
}

export function exactCell(input: HTMLInputElement): ExactCell {
  let written: { text: string; value: number } | null = null;
  return {
    untouched: () => (written !== null && input.value === written.text ? written.value : null),
    write: (value, text) => {
      input.value = text;
      written = value === null ? null : { text: input.value, value };
    },
  };
}
