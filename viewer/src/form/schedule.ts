/** A schedule as people see it: in one sentence, and how far the shape is on its way over the steps as a curve. */
import type { Json } from "../connection/protocol";
import { element, svg, write } from "../dom";
import { digits } from "../number";
import { isObject } from "../store/draft";

/** A schedule in one sentence, such as "10 shapes over 20 steps". */
export function scheduleSentence(schedule: Json | undefined): string {
  if (!isObject(schedule)) return "Schedule";
  const { steps, every } = schedule;
  if (typeof steps !== "number") return "Schedule";
  const shapes = steps === 1 ? "1 shape" : `${steps} shapes`;
  if (isObject(every) && typeof every.steps === "number") {
    const all = steps * every.steps;
    return steps === 1 ? "In 1 shape, at once" : `${shapes} over ${all} ${all === 1 ? "step" : "steps"}`;
  }
  if (isObject(every) && typeof every.time === "number") return `${shapes} over ${digits(steps * every.time, 3)} of simulated time`;
  return shapes;
}

/** A curve from 0 to 1 both ways, with what it shows in words. */
export interface Curve { points: readonly (readonly [number, number])[]; label: string }

/** The most shapes that are drawn: more would lie in one pixel. */
const DRAWN = 40;

/** The fraction of the way over the time of a schedule, as `deform/src/schedule.rs` has it; null where it says no more than the sentence. */
export function scheduleCurve(schedule: Json | undefined): Curve | null {
  if (!isObject(schedule) || typeof schedule.steps !== "number" || !(schedule.steps > 1)) return null;
  const isSmooth = schedule.ease === "smooth";
  const isInJumps = schedule.motion === "at_once";
  const shapes = Math.min(schedule.steps, DRAWN);
  const eased = (s: number): number => (isSmooth ? s * s * (3 - 2 * s) : s);
  const points: [number, number][] = [[0, 0]];
  for (let shape = 1; shape <= shapes; shape++) {
    const way = eased(shape / shapes);
    // In jumps the mesh is there at once, and rests until the next shape is due.
    if (isInJumps) points.push([(shape - 1) / shapes, way]);
    points.push([shape / shapes, way]);
  }
  const how = isSmooth ? "sets off and stops gently" : "goes evenly";
  return { points, label: `The shape ${how}${isInJumps ? ", in jumps" : ""}` };
}

const [WIDTH, HEIGHT] = [36, 14];

/** The sentence and the curve, in the head of what unfolds to the schedule's fields. */
export class ScheduleSummary {
  private readonly sentence = element("span");
  private readonly picture = svg("svg", { role: "img", viewBox: `-1 -1 ${WIDTH + 2} ${HEIGHT + 2}` });
  private readonly line = svg("polyline");
  readonly root = element("summary", {}, this.sentence, this.picture);

  constructor() {
    this.picture.append(this.line);
  }

  show(schedule: Json | undefined): void {
    write(this.sentence, scheduleSentence(schedule));
    const curve = scheduleCurve(schedule);
    this.picture.toggleAttribute("hidden", curve === null);
    if (!curve) return;
    this.picture.setAttribute("aria-label", curve.label);
    this.line.setAttribute("points", curve.points.map(([x, y]) => `${(x * WIDTH).toFixed(1)},${((1 - y) * HEIGHT).toFixed(1)}`).join(" "));
  }
}
