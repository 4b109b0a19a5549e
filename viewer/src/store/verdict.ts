/** The one verdict on what stands in the form, of the preview and the forecast: pure functions of the state. */
import type { Vector } from "../connection/protocol";
import type { Values } from "../form/schema";
import { digits, seconds } from "../number";
import { asksNothing, bodyOf, chosen, isObject, missing, openBoundariesMoved, openBoundariesUnknown } from "./draft";
import { whyNotEditable } from "./edits";
import { whyNotSteering } from "./run";
import type { State } from "./state";

export type Tone = "none" | "waiting" | "plain" | "good" | "warning" | "bad";

/** A line of the verdict, and what unfolds beneath it. */
export interface Line { tone: Tone; text: string; details: string }

const NOTHING: Line = { tone: "none", text: "", details: "" };

export function previewLine({ preview }: Pick<State, "preview">): Line {
  switch (preview.state) {
    case "none": return NOTHING;
    case "waiting": return preview.largest === null ? { tone: "waiting", text: "Preview: being computed …", details: "" } : { ...shownLine(preview), tone: "waiting" };
    case "failed": return { tone: "warning", text: "Preview: none", details: preview.reason ?? "" };
    case "shown": return shownLine(preview);
  }
}

function shownLine({ largest, size, faults }: State["preview"]): Line {
  if (faults) return { tone: "bad", text: "Preview: the surface would be broken", details: faults };
  if (!largest) return { tone: "plain", text: "Preview: nothing moves", details: "" };
  const part = size ? ` (${digits((100 * largest) / size, 2)} % of its size)` : "";
  return { tone: "plain", text: `Preview: moves the surface by up to ${digits(largest, 3)}${part}`, details: "" };
}

export function forecastLine({ forecast: { state, answer, reason }, status }: Pick<State, "forecast" | "status">): Line {
  if (state === "none") return NOTHING;
  if (state === "waiting") return { tone: "waiting", text: "Forecast: being computed …", details: "" };
  if (state === "failed" || !answer) return { tone: "warning", text: "Forecast: none", details: reason ?? "" };
  if (answer.outcome === "rejected") {
    const part = answer.fraction ? `: ${percent(answer.fraction)} of it would pass` : "";
    return { tone: "bad", text: `Forecast: it would be refused${part}`, details: answer.reason ?? "no reason was given" };
  }
  const { quality } = answer;
  const now = status?.quality ? ` (now ${digits(status.quality.min, 3)})` : "";
  const text = quality ? `least quality ${digits(quality.min, 3)}${now}, ${quality.inverted ?? 0} inverted`
    : answer.judged === "surface" ? "passes; only the surface is judged" : "passes";
  const details: string[] = [];
  if (typeof quality?.mean === "number") details.push(`mean quality ${digits(quality.mean, 3)}`);
  if (typeof answer.shapes === "number") details.push(answer.shapes === 1 ? "in 1 shape" : `in ${answer.shapes} shapes`);
  if (answer.sub_steps) details.push(`${answer.sub_steps} sub-steps`);
  const spent = answer.seconds;
  if (spent) details.push(`computed in ${seconds((spent.surface ?? 0) + (spent.volume ?? 0) + (spent.guard ?? 0))}`);
  const clamped = answer.outcome === "clamped";
  return { tone: clamped ? "warning" : "good", text: `Forecast: ${clamped ? `${percent(answer.fraction ?? 0)} of it is done, ` : ""}${text}`, details: details.join(" · ") };
}

/** A part in per cent, rounded down: what is filled in for it does pass. */
export const percent = (fraction: number): string => `${fraction >= 0.1 ? Math.floor(100 * fraction) : digits(Math.floor(1000 * fraction) / 10, 2)} %`;

/** A part of which no more than a thousandth is cut off: what is filled in for one that passes. */
export const floored = (fraction: number): number => (fraction >= 1 ? 1 : Math.floor(1000 * fraction) / 1000);

/** The part of what was refused that would pass, where it is told and worth asking for; else null. */
export const passingPart = (fraction: number | null | undefined): number | null => (typeof fraction === "number" && fraction > 0.001 ? fraction : null);

/** An open boundary that would move, or may, in words; empty where none does. */
export function openBoundaryWarning(state: State): string {
  const [first, ...more] = openBoundariesMoved(state).sort((a, b) => b.by - a.by);
  if (!first) return unknownBoundaries(state);
  const others = more.length === 0 ? "" : more.length === 1 ? `, and ${more[0]!.name} too` : `, and ${more.length} others too`;
  return `${first.name} (${first.condition}) would move by ${digits(first.by, 3)}, ${digits(100 * first.part, 2)} % of the size${others}.`;
}

function unknownBoundaries(state: State): string {
  const [first, ...more] = openBoundariesUnknown(state);
  if (first === undefined) return "";
  const others = more.length === 0 ? "" : more.length === 1 ? ` or ${more[0]!}` : ` or one of ${more.length} others`;
  return `Whether ${first}${others} moves is not known${state.preview.state === "waiting" ? " yet" : ""}.`;
}

export const NOTHING_ASKED = "Nothing is asked for yet: choose a handle and change a value, or drag in the picture.";

/** What the button that gives the order says, and why it cannot be pressed; empty where it can. */
export function applyButton(state: State): { label: string; why: string; isAnyway: boolean } {
  const { updating } = state.draft;
  const isAnyway = openBoundaryWarning(state) !== "";
  const what = updating === null ? "Apply" : `Update edit ${updating + 1}`;
  const label = isAnyway ? `${what} anyway` : what;
  const why = whyNotSteering(state) || (updating === null ? "" : whyNotEditable(state))
    || (!asksNothing(state) ? "" : updating !== null ? missing(state) || "The edit is as it was." : NOTHING_ASKED)
    || (state.forecast.answer?.outcome === "rejected" ? "It would be refused." : "");
  return { label, why, isAnyway };
}

/** The way out of a refusal: the part that would pass, whether mending can be asked for and may help, and where the worst cell is. */
export interface Remedies { fraction: number | null; untangle: boolean; worst: Vector | null }

export function remedies(state: State): Remedies | null {
  const { answer } = state.forecast;
  if (answer?.outcome !== "rejected") return null;
  return { fraction: passingPart(answer.fraction), untangle: mayUntangle(state), worst: answer.place ?? null };
}

/** Whether what is refused could pass if the guard untangled it: cells, and a surface that breaks where the edit leaves it free. */
function mayUntangle({ forecast: { answer }, preview, draft, hello, selection }: State): boolean {
  const setting = (name: "guard" | "deform"): Values => [draft.remedy[name], draft.settings[name], hello?.defaults[name]].find(isObject) ?? {};
  // Asked for already; or no volume is solved for, and none is mended.
  if (setting("guard").otherwise === "untangle" || setting("deform").method === "surface") return false;
  if (typeof answer?.min_scaled_jacobian === "number") return true;
  // Neither cells nor the surface: the edit asks for what cannot be done at all.
  if (typeof answer?.fraction !== "number") return false;
  // Sub-steps lead the free surface another way, and what the edit moves or holds to the same end.
  const placed = (["handle", "fixed"] as const).flatMap((part) => chosen({ hello, selection }, part));
  const { brokenIn } = preview;
  const isOfWholeFeatures = (bodyOf(draft).region ?? null) === null;
  return !isOfWholeFeatures || brokenIn.length === 0 || brokenIn.some((name) => !placed.includes(name));
}
