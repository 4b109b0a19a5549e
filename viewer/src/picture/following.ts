/** The camera of the one who steers: sent while somebody follows it, and followed until somebody turns the picture. */
import type { ToldCamera } from "../connection/protocol";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { isSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { sameJson } from "../store/store";
import type { Stand } from "./camera";

/** The least time between two cameras that are sent, in milliseconds. */
const PERIOD = 200;

/** Time, so that a test can stand in for it. */
export interface Clock { now(): number; later(action: () => void, milliseconds: number): void }

const browserClock: Clock = { now: () => performance.now(), later: (action, milliseconds) => { window.setTimeout(action, milliseconds); } };

export class Following {
  /** Where the camera was put last; elsewhere is where somebody has turned it to. */
  private put: Stand | null = null;
  private sent: Stand | null = null;
  private sentAt = -Infinity;
  private isWaiting = false;

  /** `shown` is called when the camera was put somewhere. */
  constructor(
    private readonly store: Store<State, Action>, private readonly commands: Commands,
    private readonly camera: { stand: Stand }, private readonly shown: (stand: Stand) => void = () => undefined,
    private readonly clock: Clock = browserClock,
  ) {
    store.watch((state) => state.following, (following) => { this.put = following ? camera.stand : null; });
  }

  /** How many follow this viewer has changed, or one more is to be shown where it is. */
  followed(by: number): void {
    this.store.dispatch({ type: "followed", by });
    this.sent = null;
    this.offer();
  }

  /** The camera of the one who steers has moved. */
  take(told: ToldCamera): void {
    if (!this.store.state.following) return;
    const stand = standOf(told);
    if (!isSound(stand)) return;
    this.camera.stand = stand;
    this.put = this.camera.stand;
    this.shown(this.put);
  }

  /** A picture was drawn: whoever has turned it follows no more, and whoever is followed shows where he is. */
  drawn(): void {
    const { state } = this.store;
    if (state.following && this.put !== null && !sameJson(this.camera.stand, this.put)) {
      this.commands.ask({ follow: { on: false } });
      this.store.dispatch({ type: "following", on: false });
    }
    if (state.followedBy > 0) this.offer();
  }

  private offer(): void {
    const { state } = this.store;
    if (state.followedBy === 0 || !isSteering(state) || this.isWaiting) return;
    const stand = this.camera.stand;
    if (sameJson(stand, this.sent) || !isSound(stand)) return;
    const left = this.sentAt + PERIOD - this.clock.now();
    if (left > 0) {
      this.isWaiting = true;
      this.clock.later(() => {
        this.isWaiting = false;
        this.offer();
      }, left);
      return;
    }
    if (this.commands.ask({ camera: toldOf(stand) }) === null) return;
    [this.sent, this.sentAt] = [stand, this.clock.now()];
  }
}

function toldOf({ position, focalPoint, viewUp, parallel, parallelScale, viewAngle }: Stand): ToldCamera {
  return { position, focal_point: focalPoint, view_up: viewUp, parallel, parallel_scale: parallelScale, view_angle: viewAngle };
}

function standOf({ position, focal_point: focalPoint, view_up: viewUp, parallel, parallel_scale: parallelScale, view_angle: viewAngle }: ToldCamera): Stand {
  return { position, focalPoint, viewUp, parallel, parallelScale, viewAngle };
}

/** Whether a camera looks from one place at another, with numbers alone. */
export function isSound({ position, focalPoint, viewUp, parallelScale, viewAngle }: Stand): boolean {
  const vectors = [position, focalPoint, viewUp];
  return vectors.every((vector) => Array.isArray(vector) && vector.length === 3 && vector.every(Number.isFinite))
    && !sameJson(position, focalPoint) && viewUp.some((part) => part !== 0)
    && Number.isFinite(parallelScale) && parallelScale > 0 && viewAngle > 0 && viewAngle < 180;
}
