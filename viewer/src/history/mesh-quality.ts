/** The quality of the mesh over time where no monitor of the run measures it: the run tells it with its status. */
import type { MonitorInformation, Status } from "../connection/protocol";
import type { History } from "./series";

/** The source of the series, which is no pipeline. */
export const MESH = "mesh quality";
/** The series has the name of the monitor that measures the same. */
export const SMALLEST = "quality.min";

/** Whether a monitor measures it. */
export function isMonitored(monitors: readonly MonitorInformation[]): boolean {
  return monitors.some(({ name }) => name === SMALLEST || name.endsWith(`.${SMALLEST}`));
}

/** Takes what a status tells; says whether there was something to take. */
export function takeQuality(history: Pick<History, "add">, monitors: readonly MonitorInformation[], { cycle, time, quality }: Status): boolean {
  if (!quality || isMonitored(monitors)) return false;
  history.add(MESH, cycle, time, { [SMALLEST]: quality.min });
  return true;
}
