/** The colours of the picture that are not a field's. */
import type { Colour } from "./colour";

export type Theme = "dark" | "light";

export const THEMES: Record<Theme, { background: Colour; edge: Colour }> = {
  dark: { background: [0.086, 0.094, 0.106], edge: [0.45, 0.47, 0.49] },
  light: { background: [0.96, 0.965, 0.97], edge: [0.45, 0.47, 0.49] },
};
