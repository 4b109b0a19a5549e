/** The views that the simulation streams: which are seen, how opaque, and which one is being changed. */
import type { ViewInformation } from "../connection/protocol";
import { arrange, element, holdFocus, identifier, write } from "../dom";
import { own } from "../own";
import { LINE, WORST, sourceOf } from "../store/pipelines";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import { sameJson, sameParts } from "../store/store";
import type { Store } from "../store/store";

/** The views that this page makes say what they are by their names. */
const MADE = [WORST, LINE];

/** What a view is of: the stage of its pipeline, for the run calls all that is no surface a slice. Of that it is told nothing until the pipelines are known. */
function kindText(state: State, { name, kind }: ViewInformation): string {
  const source = sourceOf(state.pipelines.known.find((pipeline) => pipeline.name === name)) ?? (kind === "surface" ? kind : "");
  return source === name || MADE.includes(name) ? "" : source;
}

export class ViewList {
  constructor(private readonly root: HTMLElement, private readonly store: Store<State, Action>) {
    store.watch((state) => state.hello?.views ?? [], (views) => this.list(views), sameJson);
    store.watch((state) => [state.looks, state.chosenView, state.coarser, state.pipelines.known], () => this.show(), sameParts);
  }

  private list(views: readonly ViewInformation[]): void {
    const focusAgain = holdFocus(this.root, ({ dataset }) => dataset.view, () => {
      this.root.tabIndex = -1;
      this.root.focus();
    });
    // A row that stays is not touched: its slider may be held.
    const known = new Map([...this.root.querySelectorAll<HTMLElement>("[data-view]")].map((row) => [row.dataset.view, row]));
    const rows = views.map((view) => known.get(view.name) ?? this.row(view));
    arrange(this.root, rows.length > 0 ? rows : [element("p", { class: "hint" }, "No views are streamed.")]);
    this.show();
    focusAgain();
  }

  private row({ name }: ViewInformation): HTMLElement {
    const id = identifier("view");
    const opacity = element("input", {
      type: "range", min: 0, max: 100, step: 5, "data-act": "opacity", "aria-label": `${name}: opacity`, title: "opacity",
      oninput: () => this.store.dispatch({ type: "look", view: name, look: { opacity: Number(opacity.value) / 100 } }),
    });
    const visible = element("input", {
      type: "checkbox", id, "data-act": "shown", title: "shown", onchange: () => this.store.dispatch({ type: "look", view: name, look: { visible: visible.checked } }),
    });
    const chosen = element("button", {
      type: "button", class: "choose", "data-act": "choose", title: "Change how this view looks", onclick: () => this.store.dispatch({ type: "view chosen", view: name }),
    }, name, element("small", { class: "kind" }));
    visible.setAttribute("aria-label", `${name}: shown`);
    return element("div", { class: "view", "data-view": name }, element("label", { class: "shown" }, visible), chosen,
      element("small", { class: "precision", role: "status" }, element("span", { "aria-hidden": "true" }), element("span", { class: "unseen" })), opacity);
  }

  private show(): void {
    const { hello, looks, chosenView, coarser } = this.store.state;
    for (const row of this.root.querySelectorAll<HTMLElement>("[data-view]")) {
      const view = hello?.views.find(({ name }) => name === row.dataset.view);
      const kind = row.querySelector<HTMLElement>(".kind")!;
      write(kind, view ? kindText(this.store.state, view) : "");
      kind.hidden = kind.textContent === "";
      const times = own(coarser, row.dataset.view ?? "") ?? 1;
      const precision = row.querySelector<HTMLElement>(".precision")!;
      precision.hidden = times <= 1;
      // Short beside the name, so that nothing in the panel moves when it comes and goes.
      const words = times <= 1 ? "" : `within ${times} times the error asked for: this page falls behind the run`;
      precision.title = words;
      write(precision.querySelector<HTMLElement>("[aria-hidden]")!, times <= 1 ? "" : `error × ${times}`);
      write(precision.querySelector<HTMLElement>(".unseen")!, words);
      const look = own(looks, row.dataset.view ?? "");
      if (!look) continue;
      row.querySelector<HTMLInputElement>('input[type="checkbox"]')!.checked = look.visible;
      const opacity = row.querySelector<HTMLInputElement>('input[type="range"]')!;
      opacity.value = String(Math.round(100 * look.opacity));
      opacity.disabled = !look.visible;
      row.querySelector("button")!.setAttribute("aria-pressed", String(row.dataset.view === chosenView));
    }
  }
}
