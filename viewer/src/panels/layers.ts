/** The layers of the shape: each can be muted, moved and taken out. Every change is an order of the whole new stack. */
import { element } from "../dom";
import { describeEdit } from "../form/form";
import type { Json } from "../connection/protocol";

type Body = { [key: string]: Json };

/** The stack with the layer at `place` muted or heard again. */
export function toggleMute(stack: readonly Json[], place: number): Json[] {
  return stack.map((edit, i) => {
    const [key, body] = Object.entries((i === place ? edit : null) ?? {})[0] ?? [];
    if (key === undefined || typeof body !== "object" || body === null || Array.isArray(body)) return edit;
    const { muted, ...rest } = body as Body;
    return { [key]: muted === true ? rest : { ...rest, muted: true } };
  });
}

/** The stack with the layer at `from` at `to`. */
export function move(stack: readonly Json[], from: number, to: number): Json[] {
  const rest = stack.filter((_, i) => i !== from);
  return [...rest.slice(0, to), stack[from]!, ...rest.slice(to)];
}

/** Shows the layers, the oldest first; `order` is called with the new stack. */
export function showLayers(root: HTMLElement, stack: readonly Json[], order: (stack: Json[]) => void): void {
  root.replaceChildren(...stack.map((edit, i) => {
    const text = describeEdit(edit);
    const button = (sign: string, label: string, disabled: boolean, changed: () => Json[]): HTMLElement =>
      element("button", { type: "button", class: "small", title: label, "aria-label": `${label}: ${text}`, disabled, onclick: () => order(changed()) }, sign);
    const muted = text.endsWith("(muted)");
    return element("li", { "data-muted": muted ? "true" : "false" }, element("span", { class: "layer" }, text),
      button("↑", "Earlier", i === 0, () => move(stack, i, i - 1)),
      button("↓", "Later", i === stack.length - 1, () => move(stack, i, i + 1)),
      button(muted ? "○" : "●", muted ? "Unmute" : "Mute", false, () => toggleMute(stack, i)),
      button("×", "Remove", false, () => stack.filter((_, other) => other !== i)));
  }));
}
