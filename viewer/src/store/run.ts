/** What the state says of the run and of who steers: pure functions. */
import type { State } from "./state";

/** How the run stands, as far as is known: after a bare loss of the connection nobody can say. */
export type RunState = "unknown" | "running" | "paused" | "stopping" | "ended";

export function runState({ connection, status, end }: State): RunState {
  if (end) return "ended";
  if (connection.state !== "connected" || !status) return "unknown";
  return status.stopped ? "stopping" : status.paused ? "paused" : "running";
}

/** Whether this viewer's commands are obeyed. */
export const isSteering = (state: State): boolean => whyNotSteering(state) === "";

/** Why this viewer's commands would not be obeyed, in words; empty where they are. */
export function whyNotSteering(state: State): string {
  const { connection, hello, status, end } = state;
  if (end) return "The run has ended.";
  if (connection.state !== "connected" || !hello) return "There is no connection to the simulation.";
  if (status?.stopped) return "The run is coming to its end.";
  if (hello.role === "driver") return "";
  if (hello.may_drive === false) return "This link is for watching only.";
  return status?.driver === null || status?.driver === undefined ? "Nobody steers: ask to steer first." : `Viewer ${status.driver} steers: ask to steer first.`;
}
