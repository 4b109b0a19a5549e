/** The names that a pipeline may use: those of the run, and those of what its own stages make. Pure functions. */
import type { FieldInformation, Json, MonitorInformation } from "../connection/protocol";
import { QUALITY } from "../store/pipelines";
import type { State } from "../store/state";
import type { Path } from "./place";
import { isBody, isLookedAt, madeFields, madeMonitors } from "./stages";
import type { KnownNames } from "./suggestions";

/** The names of a run. */
export interface RunNames extends Omit<KnownNames, "monitors"> {
  monitors: readonly MonitorInformation[];
}

export function namesOf({ hello, pipelines }: Pick<State, "hello" | "pipelines">): RunNames {
  const described = ({ association, components, unit }: FieldInformation): string =>
    `${components === 1 ? "A scalar" : components === 3 ? "A vector" : `${components} components`} at each ${association}${unit ? `, in ${unit}` : ""}.`;
  const channels = [hello?.channel, ...pipelines.known.map(({ channel }) => channel)].filter((name): name is string => typeof name === "string");
  return {
    fields: (hello?.fields ?? []).map((field) => ({ name: field.name, description: described(field) })),
    features: hello?.features.map(({ name }) => name) ?? [], monitors: hello?.monitors ?? [],
    channels: [...new Set(channels)], parameters: hello?.parameters.map(({ name }) => name) ?? [],
  };
}

/** Whether the fields and features of a run are those that a pipeline reads: of the channel whose mesh orders change, which is the solver's first where none is named. */
export function readsDescribed({ hello, pipelines }: Pick<State, "hello" | "pipelines">, pipeline: Json): boolean {
  const channel = isBody(pipeline) ? pipeline.channel : null;
  if (typeof channel === "string") return channel === hello?.channel;
  return pipelines.known.every((known) => known.on !== "order" || typeof known.channel !== "string");
}

/** The names that may be written at a path of a pipeline; `replaced` is the pipeline of the run that it takes the place of. */
export function namesAt(run: RunNames, pipeline: Json, replaced: string | null, path: Path): KnownNames {
  const measured = { name: QUALITY, description: "The quality of the cells: 1 is ideal, 0 is inverted." };
  const fields = [...run.fields, measured, ...madeFields(pipeline, path).filter((field) => isLookedAt(field, path))];
  const isFirst = ({ name }: { name: string }, index: number): boolean => fields.findIndex((field) => field.name === name) === index;
  return { ...run, fields: fields.filter(isFirst), monitors: monitorsAt(run, pipeline, replaced, path) };
}

/** The monitors of the pipeline itself, then those of others: with the name of their pipeline where their own is not enough. */
function monitorsAt(run: RunNames, pipeline: Json, replaced: string | null, path: Path): string[] {
  const own = madeMonitors(pipeline, path);
  const others = run.monitors.filter((monitor) => monitor.pipeline !== replaced);
  const isClear = (name: string): boolean => !own.includes(name) && others.filter((other) => other.name === name).length === 1;
  return [...new Set([...own, ...others.map((other) => (isClear(other.name) ? other.name : `${other.pipeline}/${other.name}`))])];
}
