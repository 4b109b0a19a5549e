/** What all plots below the picture have in common. */
import type uPlot from "uplot";
import { within } from "../number";

/** A colour that is looked up whenever it is drawn: the theme of the page may be another one by then. */
type Colour = () => string;
interface Grid { stroke: Colour; width: number }

const lookedUp = (root: HTMLElement, name: string): Colour => () => getComputedStyle(root).getPropertyValue(name).trim();

/** How many series have a colour of their own. */
export const SERIES_COLOURS = 8;
const seriesName = (series: number): string => `--plot-${(series % SERIES_COLOURS) + 1}`;
/** The colour of a series for what is drawn. */
export const seriesColour = (root: HTMLElement, series: number): Colour => lookedUp(root, seriesName(series));
/** The colour of a series for an element of the page. */
export const seriesStyle = (series: number): string => `var(${seriesName(series)})`;

/** How axes and their grid look, by the theme of the page. */
export function axesOf(root: HTMLElement): { grid: Grid; axis: { stroke: Colour; grid: Grid; ticks: Grid; font: string } } {
  const grid = { stroke: lookedUp(root, "--line"), width: 1 };
  return { grid, axis: { stroke: lookedUp(root, "--soft"), grid, ticks: grid, font: "11px sans-serif" } };
}

/** A plot shows no smaller part of its values than this: the labels of an axis have twelve digits. */
const FINEST = 1e-9;

/** Nor does one over time, in which what only rounds and iterates would look like something that has happened. */
const CALMEST = 1e-4;

type Range = (plot: uPlot, low: number | null, high: number | null) => [number, number];

/** A little room above and below, so that no less than a part `finest` of the values is shown; a line that is level lies in the middle. */
const padding = (finest: number): Range => (_, low, high) => {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  const room = high > low ? Math.max(0.06 * (high - low), (finest * size - (high - low)) / 2) : size * 0.1 || 1;
  return [low - room, high + room];
};

export const padded = padding(FINEST);
export const calm = padding(CALMEST);

/** The values at an axis, with the digits that tell them apart. */
export function labelled(_: uPlot, ticks: number[]): string[] {
  return ticks.map((tick) => within(tick, [ticks[0] ?? 0, ticks.at(-1) ?? 1]));
}

/** The width of an axis in which its longest label has room, and no less than `least`. In a small range labels are long. */
export const roomy = (least: number) => (plot: uPlot, labels: string[] | null, axis: number): number => {
  const { font, ticks, gap } = plot.axes[axis] as { font?: string | [string]; ticks?: { size?: number }; gap?: number };
  // uPlot keeps the font with its size in pixels of the screen.
  plot.ctx.font = (typeof font === "string" ? font : font?.[0]) ?? "";
  const longest = Math.max(0, ...(labels ?? []).map((label) => plot.ctx.measureText(label).width / devicePixelRatio));
  return Math.max(least, Math.ceil(longest + (ticks?.size ?? 0) + (gap ?? 0)));
};
