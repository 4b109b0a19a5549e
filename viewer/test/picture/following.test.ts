import { beforeEach, describe, expect, it } from "vitest";
import type { ToldCamera } from "../../src/connection/protocol";
import type { Stand } from "../../src/picture/camera";
import { Following } from "../../src/picture/following";
import { page } from "../page";

const STAND: Stand = { position: [0, -3, 0], focalPoint: [0, 0, 0], viewUp: [0, 0, 1], parallel: false, parallelScale: 1, viewAngle: 30 };
const TOLD: ToldCamera = { position: [5, 0, 0], focal_point: [0, 0, 0], view_up: [0, 1, 0], parallel: true, parallel_scale: 2, view_angle: 30 };

describe("the camera of the one who steers", () => {
  let made: ReturnType<typeof page>;
  let camera: { stand: Stand };
  let following: Following;
  let now: number;
  let later: { action: () => void; at: number }[];
  const cameras = (): unknown[] => made.sent.flatMap((message) => ("camera" in message ? [message.camera] : []));
  const turn = (x: number): void => {
    camera.stand = { ...STAND, position: [x, -3, 0] };
    following.drawn();
  };
  const pass = (milliseconds: number): void => {
    now += milliseconds;
    const due = later.filter(({ at }) => at <= now);
    later = later.filter(({ at }) => at > now);
    for (const { action } of due) action();
  };
  beforeEach(() => {
    made = page();
    [camera, now, later] = [{ stand: STAND }, 1000, []];
    following = new Following(made.store, made.commands, camera, undefined, { now: () => now, later: (action, milliseconds) => later.push({ action, at: now + milliseconds }) });
  });

  it("is sent while somebody follows, at most five times a second, and where it stands at last", () => {
    turn(1);
    expect(cameras()).toEqual([]);
    following.followed(1);
    expect(cameras()).toMatchObject([{ position: [1, -3, 0], focal_point: [0, 0, 0], view_angle: 30 }]);
    for (let x = 2; x < 42; x++) {
      pass(25);
      turn(x);
    }
    pass(1000);
    const sent = cameras();
    expect(sent.length).toBeGreaterThan(4);
    expect(sent.length).toBeLessThanOrEqual(7);
    expect(sent.at(-1)).toMatchObject({ position: [41, -3, 0] });
    // It stands still: nothing is sent, but for one more who follows.
    following.drawn();
    pass(1000);
    expect(cameras().length).toBe(sent.length);
    following.followed(2);
    expect(cameras().length).toBe(sent.length + 1);
    following.followed(0);
    turn(50);
    pass(1000);
    expect(cameras().length).toBe(sent.length + 1);
  });

  it("is never sent where it is nowhere", () => {
    camera.stand = { ...STAND, position: [NaN, 0, 0] };
    following.followed(1);
    expect(cameras()).toEqual([]);
  });

  it("is followed until somebody turns the picture", () => {
    made.greet({ role: "watcher" });
    following.take(TOLD);
    expect(camera.stand).toBe(STAND);
    made.store.dispatch({ type: "following", on: true });
    following.drawn();
    following.take(TOLD);
    expect(camera.stand).toEqual({ position: [5, 0, 0], focalPoint: [0, 0, 0], viewUp: [0, 1, 0], parallel: true, parallelScale: 2, viewAngle: 30 });
    following.drawn();
    expect(made.store.state.following).toBe(true);
    // What leads nowhere is passed over.
    for (const wrong of [{ position: [0, 0, 0] }, { view_up: [0, 0, 0] }, { view_angle: 0 }, { position: "x" }]) {
      following.take({ ...TOLD, ...wrong } as ToldCamera);
    }
    expect(camera.stand.position).toEqual([5, 0, 0]);
    turn(9);
    expect([made.store.state.following, made.sent.at(-1)]).toMatchObject([false, { follow: { on: false } }]);
    following.take(TOLD);
    expect(camera.stand.position).toEqual([9, -3, 0]);
  });

  it("is not followed by the one who steers", () => {
    made.greet({ role: "watcher" });
    made.store.dispatch({ type: "following", on: true });
    made.greet({ role: "driver" });
    expect(made.store.state.following).toBe(false);
  });
});
