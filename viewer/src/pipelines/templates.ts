/** Pipelines to begin with, filled with what the run has. */
import type { FeatureInformation, FieldInformation, Json, Vector } from "../connection/protocol";
import { LINE_POINTS } from "../store/pipelines";
import type { Pipeline } from "../store/pipelines";

export interface Template { key: string; label: string; make(run: TemplateRun): Pipeline }

/** What a template is made of. */
export interface TemplateRun {
  fields: readonly FieldInformation[];
  features: readonly FeatureInformation[];
  /** The box around what is seen. */
  box: readonly [Vector, Vector] | null;
}

const UNIT: readonly [Vector, Vector] = [[0, 0, 0], [1, 1, 1]];
/** A place to begin with, to a thousandth of a box: what views hold is rounded. */
const short = (value: number, size: number): number => {
  const decimals = Math.max(0, Math.min(12, 3 - Math.floor(Math.log10(size))));
  return Number(value.toFixed(decimals)) + 0;
};
const sizeOf = ([low, high]: readonly [Vector, Vector]): number => Math.max(...low.map((value, k) => high[k]! - value)) || 1;
const middle = (box: readonly [Vector, Vector]): Vector => box[0].map((value, k) => short((value + box[1][k]!) / 2, sizeOf(box))) as Vector;
/** The longest of the directions of a box. */
const longest = ([low, high]: readonly [Vector, Vector]): number => {
  const lengths = low.map((value, k) => high[k]! - value);
  return lengths.indexOf(Math.max(...lengths));
};

const named = (fields: readonly FieldInformation[], name: string): FieldInformation | undefined => fields.find((field) => field.name.toLowerCase().includes(name));
const scalar = (fields: readonly FieldInformation[]): string => (named(fields, "pressure") ?? fields.find(({ components, association }) => components === 1 && association === "vertex") ?? fields[0])?.name ?? "pressure";
const vector = (fields: readonly FieldInformation[]): string => (named(fields, "velocity") ?? fields.find(({ components }) => components === 3))?.name ?? "velocity";
const STREAM: Json[] = [{ stream: {} }];

export const TEMPLATES: readonly Template[] = [
  {
    key: "slice", label: "Slice", make: ({ box }) => {
      const around = box ?? UNIT;
      const axis = longest(around);
      return { name: "slice", every: { steps: 5 }, stages: [{ slice: { origin: middle(around), normal: [0, 1, 2].map((k) => (k === axis ? 1 : 0)) } }, ...STREAM] };
    },
  },
  {
    key: "contour", label: "Contour", make: ({ fields }) =>
      ({ name: "contour", every: { steps: 5 }, stages: [{ contour: { field: scalar(fields), values: [0] } }, ...STREAM] }),
  },
  {
    key: "line", label: "Probe along a line", make: ({ box }) => {
      const around = box ?? UNIT;
      const axis = longest(around);
      const at = middle(around);
      const end = (which: 0 | 1): Vector => at.map((value, k) => (k === axis ? short(around[which][k]!, sizeOf(around)) : value)) as Vector;
      return { name: "along a line", every: { steps: 5 }, stages: [{ probe: { line: { from: end(0), to: end(1), count: LINE_POINTS } } }, ...STREAM] };
    },
  },
  {
    key: "statistics", label: "Statistics of a field", make: ({ fields }) =>
      ({ name: `${vector(fields)} statistics`, every: { steps: 10 }, stages: [{ statistics: { field: vector(fields) } }] }),
  },
  {
    key: "force", label: "History of a force", make: ({ fields, features }) => {
      const walls = features.filter(({ condition }) => condition === "wall").map(({ name }) => name);
      return { name: "force", every: { steps: 5 }, stages: [{ surface: {} }, { force: { name: "force", ...(walls.length > 0 ? { features: walls } : {}), pressure: scalar(fields) } }] };
    },
  },
  { key: "empty", label: "Empty", make: () => ({ name: "", stages: [] }) },
];

/** A name that no pipeline has: the given one, or with a number behind it. */
export function freeName(name: string, known: readonly { name: string }[]): string {
  const isTaken = (candidate: string): boolean => known.some((pipeline) => pipeline.name === candidate);
  if (name === "" || !isTaken(name)) return name;
  for (let number = 2; ; number++) if (!isTaken(`${name} ${number}`)) return `${name} ${number}`;
}
