/** Edits and orders in words a person would use. */
import type { Json } from "../connection/protocol";
import { digits, words } from "../number";
import { isObject, partsOf } from "../store/draft";
import type { OrderForm, Values } from "./schema";

const AXES = ["x", "y", "z"];
const SIZES = ["length", "width", "height"];

/** An order in words, for lists and announcements. */
export function describeOrder(order: Json, form: OrderForm | null = null): string {
  if (!isObject(order)) return "order";
  if (order.undo !== undefined) return order.undo === 1 || order.undo === null ? "Undo" : `Undo ${JSON.stringify(order.undo)} orders`;
  const edits = Array.isArray(order.edits) ? order.edits : Array.isArray(order.stack) ? order.stack : [];
  const text = edits.map((edit) => describeEdit(edit, form)).join("; ");
  if (Array.isArray(order.stack)) return text === "" ? "Back to the reference shape" : `The shape of: ${text}`;
  return text === "" ? "order" : text;
}

/** An edit in words, such as "Throat: height × 0.5"; its own name, where it has one, comes before them. */
export function describeEdit(edit: Json, form: OrderForm | null = null): string {
  const parts = partsOf(edit);
  if (!parts) return isObject(edit) ? words(Object.keys(edit)[0] ?? "edit") : "edit";
  const { key, body } = parts;
  const where = [features(body), region(body)].filter(Boolean).join(" ");
  const done = action(key, body, form);
  const text = where === "" ? done : `${where}: ${done}`;
  return capital(typeof body.name === "string" && body.name !== "" ? `${body.name} (${text})` : text);
}

/** What an edit is called in a short row: its own name, or what it does. */
export function titleOf(edit: Json, form: OrderForm | null = null): string {
  const name = partsOf(edit)?.body.name;
  return typeof name === "string" && name !== "" ? name : describeEdit(edit, form);
}

export const isMuted = (edit: Json): boolean => partsOf(edit)?.body.muted === true;

const capital = (text: string): string => text.slice(0, 1).toUpperCase() + text.slice(1);
const numbers = (value: Json | undefined): number[] | null =>
  Array.isArray(value) && value.length > 0 && value.every((entry) => typeof entry === "number") ? value : null;

function features(body: Values): string {
  const names = Array.isArray(body.features) ? body.features.map(String) : [];
  return names.length > 3 ? `${names.slice(0, 2).join(", ")} and ${names.length - 2} more` : names.join(", ");
}

function region(body: Values): string {
  return isObject(body.region) ? `in a ${words(Object.keys(body.region)[0] ?? "region")}` : "";
}

function action(key: string, body: Values, form: OrderForm | null): string {
  const factors = numbers(body.factors);
  if (factors) {
    const changed = factors.flatMap((factor, axis) => (factor === 1 ? [] : [`${SIZES[axis] ?? axis} × ${digits(factor, 3)}`]));
    if (factors.length === 3 && new Set(factors).size === 1 && factors[0] !== 1) return `size × ${digits(factors[0], 3)}`;
    return changed.length > 0 ? changed.join(", ") : "size unchanged";
  }
  const by = numbers(body.by);
  if (by) return `moved ${along(by)}`;
  if (typeof body.degrees === "number") {
    const axis = numbers(body.axis);
    const main = axis && axis.filter((value) => value !== 0).length === 1 ? axis.findIndex((value) => value !== 0) : -1;
    return `turned by ${digits(body.degrees, 3)}°${main < 0 ? "" : ` about ${AXES[main]}`}`;
  }
  if (typeof body.distance === "number") return body.distance < 0 ? `inward by ${digits(-body.distance, 3)}` : `outward by ${digits(body.distance, 3)}`;
  if (Array.isArray(body.moves)) {
    const drags = body.moves.flatMap((move) => (isObject(move) ? [numbers(move.by) ?? []] : []));
    return drags.length === 1 ? `skeleton dragged ${along(drags[0]!)}` : `skeleton dragged by ${drags.length} nodes`;
  }
  return words(form?.edits.find((edit) => edit.key === key)?.label ?? key);
}

function along(by: readonly number[]): string {
  const moved = by.flatMap((value, axis) => (value === 0 ? [] : [axis]));
  if (moved.length === 0) return "nowhere";
  return moved.length === 1 ? `by ${digits(by[moved[0]!], 3)} along ${AXES[moved[0]!] ?? moved[0]}` : `by (${by.map((value) => digits(value, 3)).join(", ")})`;
}
