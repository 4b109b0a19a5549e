/** Which features are handles and which are held fixed; the picture and the form both show it and both change it. */

export type Part = "handle" | "fixed";

export class Selection {
  private readonly parts = new Map<string, Part>();
  private readonly listeners: (() => void)[] = [];
  private hover: string | null = null;

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  get(feature: string): Part | null {
    return this.parts.get(feature) ?? null;
  }

  /** The features that play a part, in the order of `names`. */
  chosen(part: Part, names: readonly string[]): string[] {
    return names.filter((name) => this.parts.get(name) === part);
  }

  set(feature: string, part: Part | null): void {
    if (this.get(feature) === part) return;
    if (part) this.parts.set(feature, part);
    else this.parts.delete(feature);
    this.changed();
  }

  toggle(feature: string, part: Part): void {
    this.set(feature, this.get(feature) === part ? null : part);
  }

  /** The feature under the pointer, wherever the pointer is. */
  get hovered(): string | null {
    return this.hover;
  }

  set hovered(feature: string | null) {
    if (feature === this.hover) return;
    this.hover = feature;
    this.changed();
  }

  /** Forgets features that are no more. */
  keep(names: readonly string[]): void {
    for (const name of [...this.parts.keys()]) if (!names.includes(name)) this.parts.delete(name);
    if (this.hover !== null && !names.includes(this.hover)) this.hover = null;
    this.changed();
  }

  private changed(): void {
    for (const listener of this.listeners) listener();
  }
}
