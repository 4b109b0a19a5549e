/** The quality of the mesh over time where no monitor of the run measures it: the run tells it with its status. */
import type { MonitorInformation, Status } from "../connection/protocol";
import { partsOf } from "../pipelines/stages";
import { sourceOf } from "../store/pipelines";
import type { Pipeline } from "../store/pipelines";
import type { History } from "./series";

/** The source of the series, which is no pipeline. */
export const MESH = "mesh quality";
/** The series has the name of the monitor that measures the same. */
export const SMALLEST = "quality.min";

/** Whether a monitor measures it. One of a pipeline that takes something out of the mesh before is of that part alone. */
export function isMonitored(monitors: readonly MonitorInformation[], pipelines: readonly Pipeline[] = []): boolean {
  return monitors.some(({ pipeline, name }) => (name === SMALLEST || name.endsWith(`.${SMALLEST}`)) && !isOfPart(pipelines.find((known) => known.name === pipeline)));
}

function isOfPart(pipeline: Pipeline | undefined): boolean {
  const at = pipeline?.stages.findIndex((stage) => partsOf(stage)[0] === "quality") ?? -1;
  return pipeline !== undefined && at > 0 && sourceOf({ ...pipeline, stages: pipeline.stages.slice(0, at) }) !== null;
}

/** Takes what a status tells; says whether there was something to take. As long as the pipelines of the monitors are not known, each is taken for one of the whole mesh. */
export function takeQuality(history: Pick<History, "add">, monitors: readonly MonitorInformation[], { cycle, time, quality }: Status, pipelines: readonly Pipeline[] = []): boolean {
  if (!quality || isMonitored(monitors, pipelines)) return false;
  history.add(MESH, cycle, time, { [SMALLEST]: quality.min });
  return true;
}
