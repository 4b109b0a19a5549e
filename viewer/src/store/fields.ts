/** Which fields views can be coloured by: those of the run, and those that a view carries beside them or instead of them. Pure functions. */
import type { DataFrame, FieldInformation } from "../connection/protocol";
import { own } from "../own";
import type { State } from "./state";

/** The fields of a frame; of several with one name the first, which is the one that colours. */
export function fieldsOf({ fields }: Pick<DataFrame, "fields">): FieldInformation[] {
  return fields.filter(({ name }, i) => fields.findIndex((other) => other.name === name) === i).map(({ name, association, components }) => ({ name, association, components }));
}

/** Whether two lists are of the same fields: this is asked at every frame. */
export function sameFields(a: readonly FieldInformation[] | undefined, b: readonly FieldInformation[]): boolean {
  return a?.length === b.length && b.every(({ name, association, components }, i) => name === a[i]!.name && association === a[i]!.association && components === a[i]!.components);
}

/** A field as a view carries it, else as the run has it, else as any view does; null where nobody has it. Its unit is that of the run. */
export function fieldNamed({ hello, carried }: Pick<State, "hello" | "carried">, name: string | null, view: string | null = null): FieldInformation | null {
  const named = (fields: readonly FieldInformation[] | undefined): FieldInformation | undefined => fields?.find((field) => field.name === name);
  const known = named(hello?.fields);
  const found = (view === null ? undefined : named(own(carried, view))) ?? known ?? named(Object.values(carried).flat());
  return found ? { ...found, unit: known?.unit ?? null } : null;
}

/** The names of all fields that a view can be coloured by or could be, those of the run first, and whether it carries each. */
export function choicesOf({ hello, carried }: Pick<State, "hello" | "carried">, view: string): { name: string; isCarried: boolean }[] {
  const there = own(carried, view);
  const names = new Set([...(hello?.fields ?? []), ...(there ?? [])].map(({ name }) => name));
  return [...names].map((name) => ({ name, isCarried: !there || there.some((field) => field.name === name) }));
}
