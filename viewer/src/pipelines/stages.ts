/** The stages of a pipeline, and what they make for those behind them: fields and monitors, as `pipelines/src/language` has it. */
import type { Json } from "../connection/protocol";
import type { Path } from "./place";

export type Body = { [key: string]: Json };
export const isBody = (value: unknown): value is Body => typeof value === "object" && value !== null && !Array.isArray(value);

/** A text; empty for what is none. */
export const text = (value: Json | undefined): string => (typeof value === "string" ? value : "");

/** The name of a stage or an action and what stands under it. */
export function partsOf(stage: Json | undefined): [string, Body] {
  const [name, body] = isBody(stage) ? Object.entries(stage)[0] ?? ["nothing", null] : [String(stage), null];
  return [name, isBody(body) ? body : {}];
}

/** A field that a stage adds to those of the run. */
export interface MadeField {
  name: string;
  description: string;
  /** What has it from then on: the mesh, as if it were the solver's; the extract; or pictures alone. */
  of: "mesh" | "extract" | "pictures";
}

const MEASURES = ["mean", "rms", "min", "max"];
const measuresOf = ({ measures }: Body): string[] => (Array.isArray(measures) ? measures.map(text).filter((measure) => measure !== "") : MEASURES);

/** The fields that a stage makes. */
function fieldsOf(stage: Json): MadeField[] {
  const [key, body] = partsOf(stage);
  const name = text(body.name);
  switch (key) {
    case "gradient": case "vorticity": case "divergence": case "q_criterion": case "magnitude":
      return [{ name: name || key, description: `Derived from ${text(body.field) || "a field"} by the stage ${key}.`, of: "mesh" }];
    case "expression": return name === "" ? [] : [{ name, description: "Derived by the stage expression.", of: "mesh" }];
    case "time_statistics":
      if (text(body.field) === "" || name === "") return [];
      return measuresOf(body).map((measure) => ({ name: `${name}_${measure}`, description: `Of ${text(body.field)} over time, by the stage time_statistics.`, of: "mesh" }));
    case "wall_shear_stress": return [{ name: name || key, description: "Derived on the faces of the surface by the stage wall_shear_stress.", of: "extract" }];
    case "streamlines": return [{ name: "integration_time", description: "The time from the seed.", of: "pictures" }];
    default: return [];
  }
}

const XYZ = ["x", "y", "z"];
const vector = (name: string): string[] => XYZ.map((axis) => `${name}.${axis}`);

/** The monitors of a stage by their names, but for those that are numbered: bins of a histogram, powers of a spectrum. */
function monitorsOf(stage: Json, hasFaces: boolean): string[] {
  const [key, body] = partsOf(stage);
  const has = (member: string): boolean => text(body[member]) !== "";
  const prefixed = (prefix: string, names: readonly string[]): string[] => (prefix === "" ? [] : names.map((name) => `${prefix}.${name}`));
  const name = text(body.name);
  switch (key) {
    case "quality": return prefixed(key, ["min", "mean", "max", "inverted"]);
    case "statistics": return prefixed(name || text(body.field), ["min", "max", "mean", "l2", "non_finite"]);
    case "integrate": return prefixed(name, [
      "size", ...(has("field") ? ["integral", "mean"] : []),
      ...(has("vector") ? [...vector("integral"), ...vector("mean"), ...(hasFaces ? ["flow_rate"] : [])] : []),
    ]);
    case "decimate": return prefixed(key, ["error", "triangles"]);
    case "histogram": return prefixed(name, ["lower", "upper", "below", "above"]);
    case "force": return prefixed(name, [
      ...XYZ, ...vector("moment"), "size", ...(has("pressure") ? [...vector("pressure"), "mean_pressure"] : []), ...(has("velocity") ? vector("viscous") : []),
    ]);
    case "difference": return name === "" ? [] : [name];
    case "time_statistics": return has("monitor") ? prefixed(name, [...measuresOf(body), "time"]) : [];
    case "spectrum": return prefixed(name, ["frequency", "resolution", "amplitude"]);
    default: return [];
  }
}

/** The stages of a pipeline, also of one that is being written. */
export const stagesOf = (pipeline: Json): Json[] => (isBody(pipeline) && Array.isArray(pipeline.stages) ? [...pipeline.stages] : []);

/** The stages that have run before what stands at a path. */
function stagesBefore(stages: readonly Json[], [part, index]: Path): readonly Json[] {
  return part === "stages" && typeof index === "number" ? stages.slice(0, index) : stages;
}

/** The fields that stages of a pipeline have made for what stands at a path. */
export function madeFields(pipeline: Json, path: Path): MadeField[] {
  const stages = stagesOf(pipeline);
  // What is selected is heeded from the first stage to the last.
  return (path[2] === "select" ? stages : stagesBefore(stages, path)).flatMap(fieldsOf);
}

/** Whether what stands at a path looks at a field: statistics are of the mesh alone. */
export function isLookedAt({ of }: MadeField, path: Path): boolean {
  const stage = path[2];
  return stage === "statistics" ? of === "mesh" : stage === "render" || of !== "pictures";
}

/** The monitors that a name at a path of a pipeline may mean because its stages measure them. */
export function madeMonitors(pipeline: Json, path: Path): string[] {
  const stages = stagesOf(pipeline);
  const hasFaces = stages.some((stage) => ["surface", "slice", "contour"].includes(partsOf(stage)[0]));
  // Tables, lines of the log and conditions come to all monitors; others to those that are measured by then.
  const isLate = path[2] === "csv" || path[2] === "log";
  return (isLate ? stages : stagesBefore(stages, path)).flatMap((stage) => monitorsOf(stage, hasFaces));
}
