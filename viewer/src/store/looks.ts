/** How each view looks: whether it is seen, and what its colours stand for. */
import type { FieldInformation, ViewInformation } from "../connection/protocol";
import { own } from "../own";
import { COLOUR_MAPS } from "../picture/colour";
import type { RangeChoice } from "../picture/ranges";

export type Edges = "none" | "features" | "mesh";
export const EDGES: readonly Edges[] = ["none", "features", "mesh"];

export interface Look {
  visible: boolean;
  /** From 0 to 1. */
  opacity: number;
  edges: Edges;
  /** The field that colours it; null for none. */
  field: string | null;
  /** Whether nobody has chosen the field: it is the first that suits, as soon as there is one. */
  isFieldOpen: boolean;
  /** Which component of the field; -1 for its magnitude. */
  component: number;
  map: string;
  range: RangeChoice;
}

export type Looks = Readonly<Record<string, Look>>;

/** The fields that views carry, by the name of the view; of one that has had no frame yet nobody knows. */
export type Carried = Readonly<Record<string, readonly FieldInformation[]>>;

const RANGE: RangeChoice = { kind: "auto", low: 0, high: 1, symmetric: false, logarithmic: false };

/** How a view looks at first. A surface that hides what is inside it is of little use: it is a shell of glass then. */
export function firstLook(view: ViewInformation, views: readonly ViewInformation[], fields: readonly FieldInformation[], carried?: readonly FieldInformation[]): Look {
  const isShell = view.kind === "surface" && views.some((other) => other.kind !== "surface");
  return withOpenField({
    visible: true, opacity: isShell ? 0.15 : 1, edges: "features", field: null, isFieldOpen: !isShell, component: -1,
    map: COLOUR_MAPS[0]!.name, range: RANGE,
  }, fields, carried);
}

/**
 * A look whose field nobody has chosen, by the fields that there are: the first vector, else the first of all. Where it is known what the
 * view carries, it is one of those.
 */
function withOpenField(look: Look, fields: readonly FieldInformation[], carried?: readonly FieldInformation[]): Look {
  const has = (list: readonly FieldInformation[], name: string | null): boolean => list.some((field) => field.name === name);
  // Those of the solver come before what is made of them.
  const there = carried ? [...carried.filter(({ name }) => has(fields, name)), ...carried.filter(({ name }) => !has(fields, name))] : fields;
  if (!look.isFieldOpen || there.length === 0 || has(there, look.field)) return look;
  const field = there.find(({ components }) => components === 3) ?? there[0]!;
  return { ...look, field: field.name, component: -1 };
}

/** The most looks that are kept of views that are no more. */
const KEPT = 200;

/**
 * The looks of the views that there are now: those that are new look as they do at first, the others as they did. Those of views that are
 * no more are kept before them, for they may come back.
 */
export function looksOf(views: readonly ViewInformation[], fields: readonly FieldInformation[], before: Looks, carried: Carried = {}): Looks {
  const names = new Set(views.map(({ name }) => name));
  const others = Object.entries(before).filter(([name]) => !names.has(name)).slice(-KEPT);
  return Object.fromEntries([...others, ...views.map((view): [string, Look] => {
    const [known, there] = [own(before, view.name), own(carried, view.name)];
    return [view.name, known ? withOpenField(known, fields, there) : firstLook(view, views, fields, there)];
  })]);
}

/** The looks with some of the views another. Whoever chooses a field, or the component or the range of the one that there is, has chosen it. */
export function withLook(looks: Looks, views: readonly string[], look: Partial<Look>): Looks {
  const isOpenAfter = ({ field, isFieldOpen }: Look): boolean =>
    isFieldOpen && look.field === undefined && (field === null || (look.component === undefined && look.range === undefined));
  return Object.fromEntries(Object.entries(looks).map(([name, before]) =>
    [name, views.includes(name) ? { ...before, ...look, isFieldOpen: isOpenAfter(before) } : before]));
}

/** The looks with one view seen, and no other. */
export function onlyLook(looks: Looks, view: string): Looks {
  return Object.fromEntries(Object.entries(looks).map(([name, look]) => [name, { ...look, visible: name === view, opacity: name === view ? 1 : look.opacity }]));
}

/** The looks that were kept over a reload, as far as they are looks; rubbish is passed over. */
export function readLooks(kept: unknown): Looks {
  if (typeof kept !== "object" || kept === null || Array.isArray(kept)) return {};
  return Object.fromEntries(Object.entries(kept).filter((entry): entry is [string, Look] => isLook(entry[1])));
}

function isLook(value: unknown): value is Look {
  if (typeof value !== "object" || value === null) return false;
  const { visible, opacity, edges, field, isFieldOpen, component, map, range } = value as Partial<Record<keyof Look, unknown>>;
  const { kind, low, high, symmetric, logarithmic } = (range ?? {}) as Partial<Record<keyof RangeChoice, unknown>>;
  return typeof visible === "boolean" && typeof opacity === "number" && opacity >= 0 && opacity <= 1 && EDGES.includes(edges as Edges)
    && (field === null || typeof field === "string") && typeof isFieldOpen === "boolean" && Number.isInteger(component) && COLOUR_MAPS.some((known) => known.name === map)
    && ["auto", "over time", "fixed"].includes(kind as string) && Number.isFinite(low) && Number.isFinite(high)
    && typeof symmetric === "boolean" && typeof logarithmic === "boolean";
}

/** What a view's colours have in common with those of others: they share a bar and a range. */
export function colourKey({ field, component, map, range }: Look): string | null {
  return field === null ? null : JSON.stringify([field, component, map, range]);
}
