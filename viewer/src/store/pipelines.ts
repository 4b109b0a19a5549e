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

/** The planes of a pipeline's slice, of which it may have several; none where it has no slice, or one by something else. */
export function planesOf(pipeline: Pipeline | undefined): Plane[] {
  const single = planeOf(pipeline);
  if (single) return [single];
  const planes = sliceOf(pipeline)?.planes;
  return (Array.isArray(planes) ? planes : []).flatMap((plane) => (typeof plane === "object" && plane !== null && !Array.isArray(plane) && isVector(plane.origin) && isVector(plane.normal)
    ? [{ origin: plane.origin, normal: plane.normal }] : []));
}

/** The plane whose place says where a pipeline cuts: the first of those that it has, which move together; null where they have no direction in common. */
export function leadingPlane(pipeline: Pipeline | undefined): Plane | null {
  const [first, ...others] = planesOf(pipeline);
  return first && others.every((other) => isParallel(first.normal, other.normal)) ? first : null;
}

const isParallel = (a: Vector, b: Vector): boolean => {
  const along = a.reduce((sum, part, k) => sum + part * b[k]!, 0);
  return Math.abs(along) > (1 - 1e-9) * Math.hypot(...a) * Math.hypot(...b);
};

const sliceOf = (pipeline: Pipeline | undefined): Body | null => pipeline?.stages.map((stage) => body(stage, "slice")).find((slice) => slice !== null) ?? null;

/** Why a pipeline's slice has no one place along a direction, in words; empty where it has, or where there is no slice. */
export function whyNotMoved(pipeline: Pipeline | undefined): string {
  const slice = sliceOf(pipeline);
  if (!slice || leadingPlane(pipeline)) return "";
  return planesOf(pipeline).length > 1 ? "The planes of this slice have several directions." : `This slice is cut by a ${["sphere", "cylinder"].find((shape) => body(slice, shape)) ?? "surface"}, not by a plane.`;
}

/** The pipeline with its leading plane elsewhere. Other planes go with it, as far from it as they were. */
export function withPlane(pipeline: Pipeline, { origin, normal }: Plane): Pipeline {
  const planes = planesOf(pipeline);
  const [first] = planes;
  const moved = planes.map((plane) => beside(plane, first!, { origin, normal }));
  const slice: Body = planes.length > 1 ? { planes: moved.map((plane) => ({ ...plane })) } : { origin, normal };
  return { ...pipeline, stages: pipeline.stages.map((stage) => (body(stage, "slice") ? { slice } : stage)) };
}

/** Where a plane is that was parallel to one that is another one now. */
function beside(plane: Plane, before: Plane, now: Plane): Plane {
  const distance = offsetOf({ ...plane, normal: before.normal }) - offsetOf(before);
  if (!isParallel(before.normal, now.normal)) return atOffset(now, offsetOf(now) + distance);
  const offset = offsetOf({ ...now, normal: before.normal }) + distance;
  const isTurned = plane.normal.reduce((sum, part, k) => sum + part * before.normal[k]!, 0) < 0;
  return atOffset(plane, isTurned ? -offset : offset);
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
