/** The bar at the top: the connection, how the run stands, the quality of its mesh, who steers; and the banner, where something is amiss. */
import type { ConnectionState } from "../connection/connection";
import type { RunEnd } from "../connection/protocol";
import { part, write } from "../dom";
import { digits, seconds } from "../number";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { runState, slowLink, titleOf, whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

const CONNECTIONS: Record<ConnectionState, string> = {
  connecting: "connecting", connected: "connected", reconnecting: "reconnecting", refused: "not let in", dismissed: "dismissed", ended: "ended",
};
const ENDS: Record<RunEnd["how"], string> = { finished: "steps reached", stopped: "stopped", failed: "failed" };

/** Without a word from the simulation for this long, or for ten of its steps, the bar says so. */
const SILENCE = 4000;

export class StatusBar {
  private heard = 0;

  constructor(private readonly store: Store<State, Action>, commands: Commands) {
    part("pause").addEventListener("click", () => commands.pauseOrResume());
    store.watch((state) => state.connection, () => this.alive());
    // A status comes also where the solver has taken no step: then it is a sign of the server alone.
    store.watch(({ status }) => [status?.cycle, status?.paused, status?.stopped], () => this.alive(), sameJson);
    store.watch((state) => state, (state) => this.show(state));
    setInterval(() => this.silence(), 1000);
  }

  /** The simulation has said something. */
  alive(): void {
    this.heard = performance.now();
    this.silence();
  }

  private show(state: State): void {
    const { connection: { state: connection, explanation }, hello, status, played, end } = state;
    const pill = part("connection");
    pill.dataset.state = connection;
    write(pill, CONNECTIONS[connection]);
    pill.title = explanation || (connection === "connected" ? "The simulation streams to this viewer." : "");
    const banner = part("banner");
    banner.hidden = end === null && (connection === "connected" || connection === "connecting");
    banner.dataset.state = connection;
    write(part("banner-text"), bannerText(state));
    part("retry").hidden = end !== null || connection === "ended";

    const run = part("run");
    const now = runState(state);
    run.dataset.state = now;
    write(run, runText(state));
    run.title = now === "unknown" && status ? "There is no connection: nobody here can say how the run stands." : "";
    write(part("channel"), hello?.channel ?? "");

    const role = part("role");
    role.dataset.role = hello?.role ?? "";
    write(role, !hello || end ? "" : hello.role === "driver" ? "you steer" : hello.may_drive === false || (status?.driver ?? null) === null ? "watching" : `watching · ${titleOf(state, String(status?.driver))} steers`);

    const pause = part("pause") as HTMLButtonElement;
    const why = whyNotSteering(state);
    pause.disabled = why !== "";
    pause.title = why;
    pause.dataset.paused = String(status?.paused === true);
    write(pause, status?.paused ? "Resume" : "Pause");

    if (!status) return;
    // A recording is where its slider is; its statuses were seldom told.
    const { cycle, time } = hello?.recording && played ? played : status;
    write(part("cycle"), String(cycle));
    write(part("time"), digits(time, 5));
    write(part("step"), seconds(status.step_seconds));
    const viewers = status.viewers === undefined ? "–" : String(status.viewers);
    write(part("viewers"), viewers);
    part("viewers").setAttribute("aria-label", `viewers ${viewers}: people and links`);
    const quality = status.quality;
    const shown = part("quality");
    write(shown, quality ? digits(quality.min, 3) : "–");
    const inverted = quality?.inverted ?? 0;
    shown.dataset.level = !quality ? "" : inverted > 0 || quality.min <= 0 ? "bad" : quality.min < 0.05 ? "low" : "good";
    shown.setAttribute("aria-label", quality ? `min quality ${digits(quality.min, 3)}: show the worst cells` : "min quality");
    shown.title = quality ? `smallest scaled Jacobian ${digits(quality.min, 4)}, mean ${digits(quality.mean, 3)}, ${inverted} inverted elements; a click shows the worst` : "";
    const lost = part("journal");
    lost.hidden = !status.journal_lost;
    write(lost, status.journal_lost ? `no orders are taken: the journal cannot be written (${status.journal_lost})` : "");
  }

  private silence(): void {
    const { state } = this.store;
    const { connection, status, end, hello } = state;
    const quiet = performance.now() - this.heard;
    // No simulation speaks in a recording.
    const still = status?.stopped === true || status?.paused === true || end !== null || Boolean(hello?.recording);
    const isSilent = connection.state === "connected" && !still && quiet >= Math.max(SILENCE, 10000 * (status?.step_seconds ?? 0));
    const words = isSilent ? `The simulation has not said a word for ${Math.round(quiet / 1000)} s. The picture may be old.` : slowLink(state, performance.now());
    part("silence").hidden = words === "";
    write(part("silence"), words);
  }
}

/** How the run stands, or whether a recording of it goes on. */
function runText(state: State): string {
  const now = runState(state);
  if (state.end) return `ended: ${ENDS[state.end.how]}`;
  if (!state.hello?.recording || now === "unknown") return now;
  return `recording (${now === "running" ? "playing" : "paused"})`;
}

/** What is amiss with the connection or over with the run, and what can be done. */
export function bannerText({ connection: { state, explanation }, end }: Pick<State, "connection" | "end">): string {
  if (end) return `The run ended at cycle ${end.cycle}: ${ENDS[end.how]}. The picture stays as it was.`;
  switch (state) {
    case "refused": return `${explanation} Open a link that the simulation told when it started.`;
    case "dismissed": return explanation;
    case "ended": return "The run has ended. The picture stays as it was.";
    case "reconnecting": return `${explanation} Whether the run goes on is unknown. Trying again.`;
    case "connecting": case "connected": return "";
  }
}
