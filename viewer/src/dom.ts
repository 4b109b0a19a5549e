/** The few lines that stand in for a framework. */

type Properties = {
  [key: string]: string | number | boolean | undefined | ((event: Event) => void);
};

/** Makes an element: `onclick` and its like become listeners, everything else an attribute. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, properties: Properties = {}, ...children: (Node | string | null)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (typeof value === "function") made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== undefined) made.setAttribute(key, String(value));
  }
  for (const child of children) if (child !== null) made.append(child);
  return made;
}

/** Makes an element of a drawing. */
export function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string | number> = {}): SVGElementTagNameMap[K] {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  return made;
}

/** The element of index.html with this id. */
export function part(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no element "${id}"`);
  return found;
}

/** Writes a text only where it differs, so that nothing is laid out anew without need. */
export function write(target: Element, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

/** Gives an element these children. Those that it has already stay in the document: a press on one goes on, and so does a drag. */
export function arrange(parent: Element, children: readonly Element[]): void {
  const wanted = new Set<Element>(children);
  for (const child of [...parent.childNodes]) if (!wanted.has(child as Element)) child.remove();
  children.forEach((child, i) => { if (parent.children[i] !== child) parent.insertBefore(child, parent.children[i] ?? null); });
}

/**
 * Sees where the focus is in a list, and gives what puts it there again once the rows are made anew: on the same control of the same row, or of the
 * row that has taken its place. Where there is none, `elsewhere` is called. A row is known by its key, a control by its `data-act`.
 */
export function holdFocus(list: HTMLElement, keyOf: (row: HTMLElement) => string | null | undefined, elsewhere: () => void): () => void {
  const active = document.activeElement as HTMLElement | null;
  if (!active || !list.contains(active)) return () => undefined;
  const rows = (): HTMLElement[] => [...list.children] as HTMLElement[];
  const at = rows().findIndex((row) => row.contains(active));
  const key = at < 0 ? null : keyOf(rows()[at]!);
  return () => {
    const row = rows().find((candidate) => keyOf(candidate) === key) ?? rows()[Math.min(at, rows().length - 1)];
    const controls = [...row?.querySelectorAll<HTMLElement>(":is(button, input):not(:disabled)") ?? []];
    const again = controls.find(({ dataset }) => dataset.act === active.dataset.act) ?? controls[0];
    if (again) again.focus();
    else elsewhere();
  };
}

/** Marks an input as wrong, and says why under the pointer; empty where nothing is wrong with it, and it has its hint. */
export function markWrong(input: HTMLElement, why: string, hint = ""): void {
  input.setAttribute("aria-invalid", String(why !== ""));
  input.title = why || hint;
}

/** The kinds of input that take no text. */
const NO_TEXT = ["button", "checkbox", "color", "file", "radio", "range", "reset", "submit"].map((type) => `:not([type=${type}])`).join("");
const TEXT = `textarea, input${NO_TEXT}, [contenteditable]:not([contenteditable=false]), .cm-editor`;

/** The field in which somebody types whose key this is, the editor of pipelines among them; null where the key is no text. */
export const textField = (target: EventTarget | null): HTMLElement | null => (target as HTMLElement | null)?.closest?.<HTMLElement>(TEXT) ?? null;

/** Whether a sheet lies over the page, for which all keys are then meant, wherever the focus is. */
export const isSheetOpen = (): boolean => document.querySelector("dialog[open]") !== null;

/** A label that is unique in the page. */
let count = 0;
export const identifier = (stem: string): string => `${stem}-${++count}`;

/** Hands something to the person as a file. */
export function download(content: Blob, name: string): void {
  const address = URL.createObjectURL(content);
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
