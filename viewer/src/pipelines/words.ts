/** A pipeline in words: what it does, when, and what that costs. */
import type { Json, PipelineCost } from "../connection/protocol";
import { digits, seconds, words } from "../number";
import { lineOf, planeOf } from "../store/pipelines";
import type { Pipeline } from "../store/pipelines";
import { isBody, partsOf, text } from "./stages";

const AXES = ["x", "y", "z"];

const names = (value: Json | undefined): string => (Array.isArray(value) ? value.filter((name) => typeof name === "string").join(", ") : "");
const number = (value: Json | undefined): string => (typeof value === "number" ? digits(value, 4) : "");
const behind = (before: string, value: string): string => (value === "" ? "" : `${before}${value}`);

function stageText(pipeline: Pipeline, stage: Json): string {
  const [name, body] = partsOf(stage);
  switch (name) {
    case "surface": return "the surface";
    case "slice": {
      const plane = planeOf(pipeline);
      const axis = plane && plane.normal.filter((part) => part !== 0).length === 1 ? plane.normal.findIndex((part) => part !== 0) : -1;
      return plane && axis >= 0 ? `slice across ${AXES[axis]} at ${digits(plane.origin[axis], 4)}` : plane ? "slice across a plane" : `slice along ${words(Object.keys(body)[0] ?? "a plane")}`;
    }
    case "contour": return `contour of ${text(body.field)} at ${Array.isArray(body.values) ? body.values.slice(0, 3).map(number).join(", ") : "?"}`;
    case "threshold": return `cells with ${text(body.field)}${behind(" from ", number(body.min))}${behind(" to ", number(body.max))}`;
    case "clip": return `cut off by ${["plane", "box", "sphere", "field"].find((by) => by in body) ?? "a plane"}`;
    case "probe": return lineOf(pipeline) ? "values along a line" : `values at ${"grid" in body ? "a grid" : "points"}`;
    case "streamlines": return `streamlines of ${text(body.field)}`;
    case "glyphs": return `${text(body.shape) || "arrow"}s${behind(" of ", text(body.field))}`;
    case "select": return names(body.fields);
    case "quality": return "quality of the cells";
    case "statistics": return `statistics of ${text(body.field)}`;
    case "integrate": return `integral${behind(" of ", [text(body.field), text(body.vector)].filter(Boolean).join(" and "))}${behind(" over ", names(body.features))}`;
    case "histogram": return `histogram of ${text(body.field)}`;
    case "force": return `force${behind(" on ", names(body.features))}`;
    case "difference": return `${text(body.name) || "difference"} = ${text(body.of)} − ${text(body.minus)}`;
    case "stream": return "streamed";
    case "write": return `written to ${text(body.file)}`;
    case "csv": return `table ${text(body.file)}`;
    case "render": return `drawn to ${text(body.file)}`;
    case "log": return "said in the log";
    case "set": return `set ${text(body.name)} to ${number(body.value)}`;
    default: return words(name);
  }
}

/** What a pipeline does, in a line. */
export function purpose(pipeline: Pipeline): string {
  if (typeof pipeline.description === "string" && pipeline.description !== "") return pipeline.description;
  const stages = pipeline.stages.map((stage) => stageText(pipeline, stage)).filter((said) => said !== "").join(" → ");
  const then = Array.isArray(pipeline.then) ? pipeline.then.map((action) => stageText(pipeline, action)).join(", ") : "";
  const when = typeof pipeline.when === "string" ? `when ${pipeline.when}` : "";
  return [stages, when === "" ? then : `${when}: ${then}`].filter((said) => said !== "").join(" · ") || "nothing";
}

/** When a pipeline runs. */
export function cadence({ every, at, on }: Pipeline): string {
  if (on === "order") return "settings of orders";
  if (on === "viewer") return "when a viewer comes";
  if (on === "end") return "at the end of the run";
  if (isBody(at)) return at.cycle === undefined ? `once, at time ${number(at.time)}` : `once, at cycle ${number(at.cycle)}`;
  if (!isBody(every)) return "every step";
  if (every.steps !== undefined) return every.steps === 1 ? "every step" : `every ${number(every.steps)} steps`;
  return every.seconds === undefined ? `every ${number(every.time)} of time` : `every ${number(every.seconds)} s`;
}

/** Bytes in the unit that suits them. */
export function bytes(value: number): string {
  if (value < 1e3) return `${Math.round(value)}\u00a0B`;
  return value < 1e6 ? `${digits(value / 1e3, 3)}\u00a0kB` : value < 1e9 ? `${digits(value / 1e6, 3)}\u00a0MB` : `${digits(value / 1e9, 3)}\u00a0GB`;
}

/** What a pipeline has cost so far; empty for one that has not run. */
export function costText(cost: PipelineCost | undefined): string {
  if (!cost || cost.runs === 0) return "";
  const each = `${seconds(cost.seconds / cost.runs)}${cost.bytes > 0 ? `, ${bytes(cost.bytes / cost.runs)}` : ""} a run`;
  return cost.every > 1 ? `${each}, at one in ${cost.every} of its times` : each;
}
