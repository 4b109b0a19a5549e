/** The bar at the top: the connection, the progress of the run, the quality of its mesh, and who steers. */
import type { ConnectionState } from "../connection/connection";
import { part, write } from "../dom";
import { digits, seconds } from "../number";
import type { Hello, RunEnd, Status } from "../connection/protocol";

const CONNECTIONS: Record<ConnectionState, string> = {
  connecting: "connecting", connected: "connected", reconnecting: "reconnecting", refused: "not let in", dismissed: "dismissed", ended: "ended",
};
/** Without a word from the simulation for this long, or for ten of its steps, the bar says so. */
const SILENCE = 4000;

export class StatusBar {
  private heard = 0;
  private still = false;
  private patience = SILENCE;
  private state: ConnectionState = "connecting";
  private last = "The run has ended.";

  constructor() {
    setInterval(() => this.silence(), 1000);
  }

  connection(state: ConnectionState, explanation: string): void {
    this.state = state;
    this.heard = performance.now();
    const pill = part("connection");
    pill.dataset.state = state;
    write(pill, CONNECTIONS[state]);
    pill.title = explanation || (state === "connected" ? "The simulation streams to this viewer." : "");
    const banner = part("banner");
    banner.hidden = state === "connected" || state === "connecting";
    write(part("banner-text"), state === "refused"
      ? `${explanation} Open a link that the simulation told when it started.`
      : state === "dismissed" ? explanation
      : state === "ended" ? this.last : `${explanation} Trying again.`);
    banner.dataset.state = state;
    this.silence();
  }

  role(hello: Hello, driver: Status["driver"]): void {
    const driving = hello.role === "driver";
    const text = part("role");
    write(text, driving ? "you steer" : hello.may_drive === false || driver === null || driver === undefined ? "watching only" : "watching only · another viewer steers");
    text.dataset.role = hello.role;
  }

  update(status: Status): void {
    this.heard = performance.now();
    this.still = status.stopped || status.paused;
    this.patience = Math.max(SILENCE, 10000 * (status.step_seconds ?? 0));
    write(part("cycle"), String(status.cycle));
    write(part("time"), digits(status.time, 5));
    write(part("step"), seconds(status.step_seconds));
    write(part("viewers"), status.viewers === undefined ? "–" : String(status.viewers));
    const quality = status.quality;
    const shown = part("quality");
    write(shown, quality ? digits(quality.min, 3) : "–");
    const inverted = quality?.inverted ?? 0;
    shown.dataset.level = !quality ? "" : inverted > 0 || quality.min <= 0 ? "bad" : quality.min < 0.05 ? "low" : "good";
    shown.title = quality ? `smallest scaled Jacobian ${digits(quality.min, 4)}, mean ${digits(quality.mean, 3)}, ${inverted} inverted elements` : "";
    const lost = part("journal");
    lost.hidden = !status.journal_lost;
    write(lost, status.journal_lost ? `no orders are taken: the journal cannot be written (${status.journal_lost})` : "");
    const run = part("run");
    run.dataset.state = status.stopped ? "stopped" : status.paused ? "paused" : "running";
    write(run, status.stopped ? "stopped" : status.paused ? "paused" : "running");
    this.silence();
  }

  /** The run has said that it ends. */
  end({ how, cycle }: RunEnd): void {
    const ways = { finished: "it was finished", stopped: "it was stopped", failed: "its program ended without finishing it" };
    this.last = `The run ended at cycle ${cycle}: ${ways[how]}. The picture stays as it was.`;
    this.still = true;
    const run = part("run");
    run.dataset.state = "stopped";
    write(run, how);
  }

  /** Something arrived, whatever it was. */
  alive(): void {
    this.heard = performance.now();
  }

  private silence(): void {
    const note = part("silence");
    const quiet = performance.now() - this.heard;
    note.hidden = this.state !== "connected" || this.still || quiet < this.patience;
    if (!note.hidden) write(note, `no word for ${Math.round(quiet / 1000)} s`);
  }
}
