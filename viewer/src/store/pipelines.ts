/** What the viewer changes in pipelines: where a slice lies, the quality of cells as a field, a view of the worst cells. Pure functions. */
import type { Hello, Json, QualitySummary, Vector } from "../connection/protocol";

export interface Pipeline { [key: string]: Json; name: string; stages: Json[] }
export interface Plane { origin: Vector; normal: Vector }

/** The element field that the stage `quality` measures. */
export const QUALITY = "scaled_jacobian";
/** The view that shows the worst cells. */
export const WORST = "worst cells";

type Body = { [key: string]: Json };
const body = (stage: Json, key: string): Body | null => {
  const found = typeof stage === "object" && stage !== null && !Array.isArray(stage) ? stage[key] : undefined;
  return typeof found === "object" && found !== null && !Array.isArray(found) ? found : null;
};
const isVector = (value: Json | undefined): value is Vector => Array.isArray(value) && value.length === 3 && value.every((part) => typeof part === "number");

/** The pipelines of an answer; what is none is passed over. */
export function readPipelines(answer: Json): Pipeline[] {
  return (Array.isArray(answer) ? answer : []).flatMap((one) => (typeof one === "object" && one !== null && !Array.isArray(one)
    && typeof one.name === "string" && Array.isArray(one.stages) ? [one as Pipeline] : []));
}

/** The plane of a pipeline's slice; null where it has none that is given by a point and a direction. */
export function planeOf(pipeline: Pipeline | undefined): Plane | null {
  for (const stage of pipeline?.stages ?? []) {
    const slice = body(stage, "slice");
    if (slice && isVector(slice.origin) && isVector(slice.normal)) return { origin: slice.origin, normal: slice.normal };
  }
  return null;
}

export function withPlane(pipeline: Pipeline, { origin, normal }: Plane): Pipeline {
  return { ...pipeline, stages: pipeline.stages.map((stage) => (body(stage, "slice") ? { slice: { origin, normal } } : stage)) };
}

/** Where a plane lies along its normal, from the origin of coordinates. */
export function offsetOf({ origin, normal }: Plane): number {
  const length = Math.hypot(...normal);
  return origin.reduce((sum, part, k) => sum + (part * normal[k]!) / length, 0);
}

/** The plane at another offset along its normal. */
export function atOffset(plane: Plane, offset: number): Plane {
  const length = Math.hypot(...plane.normal);
  const by = offset - offsetOf(plane);
  return { ...plane, origin: plane.origin.map((part, k) => part + (by * plane.normal[k]!) / length) as Vector };
}

/** The least and largest offset along a direction at which a box is cut. */
export function extent([low, high]: readonly [Vector, Vector], normal: Vector): [number, number] {
  const length = Math.hypot(...normal);
  const ends = normal.map((part, k): [number, number] => [(low[k]! * part) / length, (high[k]! * part) / length]);
  return [ends.reduce((sum, end) => sum + Math.min(...end), 0), ends.reduce((sum, end) => sum + Math.max(...end), 0)];
}

/** The pipeline with the quality of the cells among its fields: selected where it selects, measured behind its extract where it takes all. */
export function withQuality(pipeline: Pipeline): Pipeline {
  const { stages } = pipeline;
  const at = stages.findIndex((stage) => body(stage, "select"));
  const fields = body(stages[at] ?? null, "select")?.fields;
  if (Array.isArray(fields)) {
    return fields.includes(QUALITY) ? pipeline : { ...pipeline, stages: stages.with(at, { select: { ...body(stages[at]!, "select"), fields: [...fields, QUALITY] } }) };
  }
  if (stages.some((stage) => body(stage, "quality"))) return pipeline;
  const source = stages.findIndex((stage) => SOURCES.some((name) => body(stage, name)));
  return { ...pipeline, stages: stages.toSpliced(source + 1, 0, { quality: {} }) };
}

/** The view that takes the fields along a line. */
export const LINE = "line";
/** How many points a line has. */
export const LINE_POINTS = 201;

export function lineBetween(from: Vector, to: Vector): Pipeline {
  return { name: LINE, every: { steps: 5 }, stages: [{ probe: { line: { from, to, count: LINE_POINTS } } }, { stream: {} }] };
}

/** The line that a stage takes, by its ends. */
function lineIn(stage: Json): (Body & { from: Vector; to: Vector }) | null {
  const line = body(body(stage, "probe"), "line");
  return line && isVector(line.from) && isVector(line.to) ? { ...line, from: line.from, to: line.to } : null;
}

/** The ends of a pipeline's line; null where it takes none. */
export function lineOf(pipeline: Pipeline | undefined): { from: Vector; to: Vector } | null {
  const line = pipeline?.stages.map(lineIn).find((found) => found !== null);
  return line ? { from: line.from, to: line.to } : null;
}

/** The pipeline with its line between two other points; all else stays, for it may be one that somebody wrote. */
export function withLine(pipeline: Pipeline, from: Vector, to: Vector): Pipeline {
  const at = pipeline.stages.findIndex((stage) => lineIn(stage) !== null);
  const stage = pipeline.stages[at];
  if (stage === undefined) return pipeline;
  return { ...pipeline, stages: pipeline.stages.with(at, { ...(stage as Body), probe: { ...body(stage, "probe"), line: { ...lineIn(stage), from, to } } }) };
}

/** The stage that takes something out of the mesh; null where a pipeline has none. */
export function sourceOf(pipeline: Pipeline | undefined): string | null {
  return SOURCES.find((name) => pipeline?.stages.some((stage) => body(stage, name))) ?? null;
}

const SOURCES = ["surface", "slice", "contour", "threshold", "clip", "probe", "streamlines", "glyphs"];

/** So many of the worst cells are to be in their view, and so many at most: more would be a view of the mesh. */
const FEWEST = 10;
const MOST = 400;
/** Into how many parts of a range the cells are counted, under the name of the count's monitors. */
const PARTS = 64;
const COUNT = "cells";

/** Cells of a range of quality, as the run has counted them: those below it, and those in each part of it. */
export interface CountedCells { low: number; high: number; below: number; parts: number[] }

/** Has the cells counted whose quality lies in a range, and those below it. Nothing is streamed for it. */
export function countCells([low, high]: readonly [number, number]): Pipeline {
  return { name: WORST, every: { steps: 1 }, stages: [{ threshold: { field: QUALITY, max: high } },
    { histogram: { name: COUNT, field: QUALITY, bins: PARTS, range: [low, high] } }] };
}

/** Whether the run has the pipeline of `countCells`. */
export function isCounted(hello: Hello | null): boolean {
  return hello?.monitors?.some(({ pipeline, name }) => pipeline === WORST && name === `${COUNT}.below`) === true;
}

/** The range in which the worst cells are looked for first. */
export function poorRange({ min, mean }: QualitySummary): [number, number] {
  return [min, min + Math.max((mean ?? 1) - min, 1e-6 * Math.max(1, Math.abs(min)))];
}

/** What a monitor of `countCells` tells; null where it is of something else. */
export function countedIn(values: Readonly<Record<string, number | null>>): CountedCells | null {
  const [low, high, below] = ["lower", "upper", "below"].map((name) => values[`${COUNT}.${name}`]);
  const parts = Array.from({ length: PARTS }, (_, i) => values[`${COUNT}.bins.${i}`]);
  const isNumber = (value: number | null | undefined): value is number => typeof value === "number";
  return isNumber(low) && isNumber(high) && isNumber(below) && parts.every(isNumber) ? { low, high, below, parts } : null;
}

/**
 * Up to which quality the worst cells are shown, so that there are ten at least. Where those are too many, the range that is to be
 * counted more finely; null for neither, where as many cells are alike.
 */
export function worstUpTo({ low, high, below, parts }: CountedCells): { max: number } | { range: [number, number] } | null {
  const width = (high - low) / PARTS;
  let cells = below;
  const enough = parts.findIndex((part) => (cells += part) >= FEWEST);
  // Where there are not so many at all, all of them.
  const last = enough < 0 ? PARTS - 1 : enough;
  const from = low + last * width;
  // The end itself, without what rounding makes of it.
  const to = last === PARTS - 1 ? high : low + (last + 1) * width;
  if (cells <= MOST) return { max: to };
  return to - from > 1e-12 * Math.max(1, Math.abs(to)) ? { range: [from, to] } : null;
}

/** A view of the worst cells, each with its own value to the last bit: by that they are told apart. */
export function worstCells(max: number): Pipeline {
  return { name: WORST, every: { steps: 10 }, stages: [{ threshold: { field: QUALITY, max } }, { select: { fields: [QUALITY] } }, { stream: { error: "lossless" } }] };
}
