/** What the state says of the run and of who steers: pure functions. */
import type { State } from "./state";

/** How the run stands, as far as is known: after a bare loss of the connection nobody can say. */
export type RunState = "unknown" | "running" | "paused" | "stopping" | "ended";

export function runState({ connection, status, end, hello, played }: State): RunState {
  if (end) return "ended";
  // A status of a recording is of the run that was recorded.
  if (connection.state === "connected" && hello?.recording && played) return played.paused || played.at_end ? "paused" : "running";
  if (connection.state !== "connected" || !status) return "unknown";
  return status.stopped ? "stopping" : status.paused ? "paused" : "running";
}

/** Milliseconds by which a picture may be behind before that is said. */
const OLD = 3000;

/** How old the picture is and what was left out of it, where the link or the page is too slow for the run; empty where it keeps up. */
export function slowLink(state: State, now: number): string {
  const { frames, progress, status, hello } = state;
  // Of a recording a picture may be as old as one likes.
  if (runState(state) !== "running" || hello?.recording || frames.cycle === null || !status) return "";
  const shown = frames.cycle;
  const reached = progress.find(({ cycle }) => cycle >= shown);
  const age = reached ? now - reached.at : 0;
  if (age < OLD) return "";
  const gaps = Object.values(frames.views).flatMap((view) => view.gaps);
  const least = Math.min(...gaps, Infinity);
  const behind = status.cycle - shown;
  // A view that is seldom sent is no sign of that.
  if (!Number.isFinite(least) || behind < 3 * least) return "";
  const due = gaps.reduce((sum, gap) => sum + Math.round(gap / least), 0);
  const lost = due > gaps.length ? `; ${due - gaps.length} of the last ${due} frames were left out` : "";
  return `The picture is behind: ${Math.round(age / 1000)} s old, ${behind} cycles${lost}.`;
}

/** A viewer in words: by the name that it has given itself, which another may have too, and by that which is its own. */
export function titleOf({ people }: Pick<State, "people">, client: string): string {
  const name = people.find((person) => person.client === client)?.name;
  return name ? `${name} (${client})` : `viewer ${client}`;
}

/** Who a viewer is to the person at this one. */
export const nameOf = (state: Pick<State, "people" | "hello">, client: string): string => (client === state.hello?.client ? "you" : titleOf(state, client));

/** A text with a capital letter at its beginning. */
export const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** Whether this viewer could steer, so that it may write notes and give links for steering. */
export const mayDrive = ({ connection, hello, end }: State): boolean =>
  end === null && connection.state === "connected" && hello !== null && hello.may_drive !== false && !hello.recording;

/** Whether this viewer's commands are obeyed. */
export const isSteering = (state: State): boolean => whyNotSteering(state) === "";

/** Why this viewer's commands would not be obeyed, in words; empty where they are. */
export function whyNotSteering(state: State): string {
  const { connection, hello, status, end } = state;
  if (hello?.recording) return "This is a recording: it can be watched, and not be steered.";
  if (end) return "The run has ended.";
  if (connection.state !== "connected" || !hello) return "There is no connection to the simulation.";
  if (status?.stopped) return "The run is coming to its end.";
  if (hello.role === "driver") return "";
  if (hello.may_drive === false) return "This link is for watching only.";
  const { driver } = status ?? {};
  return driver === null || driver === undefined ? "Nobody steers: ask to steer first." : `${capital(titleOf(state, String(driver)))} steers: ask to steer first.`;
}
