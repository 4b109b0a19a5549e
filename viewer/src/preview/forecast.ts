/**
 * What the order that stands in the form would come to: the quality of the mesh that it would make, before Apply is pressed.
 *
 * The simulation finds it out beside its own work and changes nothing. One is asked for when the form has rested for a moment;
 * the server forgets those that were overtaken.
 */
import { digits, seconds } from "../number";
import type { ForecastAnswer, Json, QualitySummary } from "../connection/protocol";

/** Milliseconds without a change after which a forecast is asked for. */
const REST = 250;

export interface ForecastInspection {
  state: "none" | "waiting" | "told" | "failed";
  outcome: ForecastAnswer["order"]["outcome"] | null;
  min: number | null;
  inverted: number | null;
  fraction: number | null;
  reason: string | null;
}

const NOTHING: ForecastInspection = { state: "none", outcome: null, min: null, inverted: null, fraction: null, reason: null };

export type ForecastTone = "waiting" | "applied" | "clamped" | "rejected" | "failed" | "none";

export class Forecasts {
  private seen = NOTHING;
  private asked: string | null = null;
  private wish = "";
  private resting: ReturnType<typeof setTimeout> | undefined;

  /** `send` asks for the forecast of an order and says under what name it was asked, or null where nobody can be asked. */
  constructor(
    private readonly send: (order: Json) => string | null,
    private readonly say: (tone: ForecastTone, text: string) => void,
  ) {}

  /** The order in the form is another one; null where there is none. */
  changed(order: Json | null): void {
    if (order === null) return this.clear();
    const wish = JSON.stringify(order);
    if (wish === this.wish) return;
    this.wish = wish;
    this.asked = null;
    this.seen = { ...NOTHING, state: "waiting" };
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.asked = this.send(order);
      if (this.asked === null) this.clear();
      else this.say("waiting", "Forecast: being computed …");
    }, REST);
  }

  /** The shape that orders start from is another one: what was told holds no longer. */
  outdated(order: Json | null): void {
    if (this.wish === "") return;
    this.wish = "";
    this.changed(order);
  }

  clear(): void {
    clearTimeout(this.resting);
    this.wish = "";
    this.asked = null;
    this.seen = NOTHING;
    this.say("none", "");
  }

  answer(answer: ForecastAnswer, now: QualitySummary | null): void {
    if (this.asked === null || answer.id !== this.asked) return;
    const { order } = answer;
    this.seen = {
      state: "told", outcome: order.outcome, min: order.quality?.min ?? order.min_scaled_jacobian ?? null,
      inverted: order.quality?.inverted ?? null, fraction: order.fraction ?? null, reason: order.reason ?? null,
    };
    this.say(order.outcome, forecastText(order, now));
  }

  /** The server could not take the question of this name; whether it was one of ours. */
  refused(id: string, reason: string): boolean {
    if (this.asked === null || id !== this.asked) return false;
    this.seen = { ...NOTHING, state: "failed", reason };
    this.say("failed", `No forecast: ${reason}`);
    return true;
  }

  inspect(): ForecastInspection {
    return { ...this.seen };
  }
}

/** A forecast in words; `now` is the quality of the present shape. */
export function forecastText(order: ForecastAnswer["order"], now: QualitySummary | null): string {
  const percent = (fraction: number): string => `${digits(100 * fraction, 3)} %`;
  if (order.outcome === "rejected") {
    const part = typeof order.fraction === "number" && order.fraction > 0 ? ` ${percent(order.fraction)} of it would pass.` : "";
    return `Forecast: it would be rejected: ${order.reason ?? "no reason was given"}.${part}`;
  }
  const parts: string[] = [];
  if (order.outcome === "clamped") parts.push(`clamped to ${percent(order.fraction ?? 0)}`);
  if (order.quality) {
    const before = now ? ` (now ${digits(now.min, 3)})` : "";
    parts.push(`least quality ${digits(order.quality.min, 3)}${before}`);
    if (typeof order.quality.mean === "number") parts.push(`mean ${digits(order.quality.mean, 3)}`);
    parts.push(`${order.quality.inverted ?? 0} inverted`);
  }
  if (typeof order.shapes === "number") parts.push(order.shapes === 1 ? "in 1 shape" : `in ${order.shapes} shapes`);
  const spent = order.seconds;
  if (spent) parts.push(`computed in ${seconds((spent.surface ?? 0) + (spent.volume ?? 0) + (spent.guard ?? 0))}`);
  return `Forecast: ${parts.join(" · ")}`;
}
