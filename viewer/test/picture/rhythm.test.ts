import { beforeEach, expect, test } from "vitest";
import { LONGEST_REST, Rhythm, SHAPING } from "../../src/picture/rhythm";

let now: number, frames: (() => void)[], timers: { at: number; action: () => void }[];
let isAnimating: boolean, pending: number, cost: number, taken: number[], pictures: number;
let rhythm: Rhythm;

/** A picture, as the scene draws it. */
function draw(): void {
  pictures++;
  if (pending > 0 && rhythm.takesValues()) {
    taken.push(now);
    pending = 0;
    now += cost;
  }
  rhythm.drawn();
}
/** Lets time pass, with a chance to draw every ten milliseconds. */
function pass(milliseconds: number): void {
  for (const end = now + milliseconds; now < end; now += 10) {
    for (const action of frames.splice(0)) action();
    for (const timer of timers.filter(({ at }) => at <= now)) {
      timers.splice(timers.indexOf(timer), 1);
      timer.action();
    }
  }
}
beforeEach(() => {
  [now, frames, timers, isAnimating, pending, cost, taken, pictures] = [0, [], [], false, 0, 40, [], 0];
  rhythm = new Rhythm({ isAnimating: () => isAnimating, draw }, {
    now: () => now, frame: (action) => frames.push(action), later: (action, milliseconds) => timers.push({ at: now + milliseconds, action }),
  });
});
const arrive = (): void => {
  pending++;
  rhythm.requestGently();
};

test("new values leave as much time as they take, however often the picture is turned", () => {
  arrive();
  pass(10);
  expect(taken).toEqual([0]);
  const before = pictures;
  arrive();
  for (let i = 0; i < 3; i++) {
    rhythm.request();
    pass(10);
  }
  expect([taken.length, pictures - before]).toEqual([1, 3]);
  // Nobody asks any more: they come all the same, once they are due.
  pass(100);
  expect(taken.length).toBe(2);
  expect(taken[1]! - 40).toBeGreaterThanOrEqual(40);
});

test("who wants all that has come is not kept waiting; who waits for a picture is told with it", () => {
  arrive();
  pass(10);
  arrive();
  const told: string[] = [];
  rhythm.request(() => told.push(`next: ${taken.length}`));
  pass(10);
  rhythm.requestAll(() => told.push(`all: ${taken.length}`));
  pass(10);
  expect(told).toEqual(["next: 1", "all: 2"]);
});

test("an interaction draws by itself, and what is waited for is told once it has", () => {
  isAnimating = true;
  let told = 0;
  rhythm.request(() => told++);
  pass(50);
  expect([pictures, told]).toEqual([0, 0]);
  draw();
  expect(told).toBe(1);
});

test("new values wait for a hand that shapes, half a second at most, and come soon after it rests", () => {
  for (let shape = 0; shape < 100; shape++) {
    arrive();
    rhythm.shaped();
    rhythm.request();
    pass(20);
  }
  const apart = taken.slice(1).map((at, i) => at - taken[i]!);
  expect(apart.length).toBeGreaterThanOrEqual(2);
  for (const gap of apart) {
    expect(gap).toBeGreaterThanOrEqual(LONGEST_REST);
    expect(gap).toBeLessThanOrEqual(LONGEST_REST + 50);
  }
  const { length } = taken, rested = now;
  arrive();
  pass(SHAPING + 50);
  expect(taken.length).toBeGreaterThan(length);
  expect(taken[length]! - rested).toBeLessThanOrEqual(SHAPING + 20);
});
