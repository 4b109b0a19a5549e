/** What all plots below the picture have in common. */
import type uPlot from "uplot";
import { within } from "../number";

/** Told apart by those who do not tell red from green, too (Okabe and Ito, 2008), light enough for a dark ground. */
export const COLOURS = ["#56b4e9", "#e69f00", "#2fbf96", "#cc79a7", "#f0e442", "#d5763c", "#8f9dff", "#a5adb6"];

/** A colour that is looked up whenever it is drawn: the theme of the page may be another one by then. */
type Colour = () => string;
interface Grid { stroke: Colour; width: number }

/** How axes and their grid look, by the theme of the page. */
export function axesOf(root: HTMLElement): { grid: Grid; axis: { stroke: Colour; grid: Grid; ticks: Grid; font: string } } {
  const colour = (name: string): Colour => () => getComputedStyle(root).getPropertyValue(name);
  const grid = { stroke: colour("--line"), width: 1 };
  return { grid, axis: { stroke: colour("--soft"), grid, ticks: grid, font: "11px sans-serif" } };
}

/** A little room above and below; a line that is level lies in the middle. */
export function padded(_: uPlot, low: number | null, high: number | null): [number, number] {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const room = high > low ? 0.06 * (high - low) : Math.abs(low) * 0.1 || 1;
  return [low - room, high + room];
}

/** The values at an axis, with the digits that tell them apart. */
export function labelled(_: uPlot, ticks: number[]): string[] {
  return ticks.map((tick) => within(tick, [ticks[0] ?? 0, ticks.at(-1) ?? 1]));
}
