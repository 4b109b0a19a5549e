/** The list of the run's pipelines: what each does, when, and what that costs. Whoever steers adds, changes and removes them here. */
import { element, part, svg, write } from "../dom";
import { textOf } from "../pipelines/pretty";
import { TEMPLATES, freeName } from "../pipelines/templates";
import type { TemplateRun } from "../pipelines/templates";
import { cadence, costText, purpose } from "../pipelines/words";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { isChanged, keyOf, newKey } from "../store/pipeline-drafts";
import type { AskedChange, PipelineDraft } from "../store/pipeline-drafts";
import type { Pipeline } from "../store/pipelines";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";

export class PipelinesPanel {
  private readonly list = part("pipelines");
  /** The pipeline that is to be removed, once that is confirmed. */
  private removing: string | null = null;

  /** `box` is the box around what is seen, in which new pipelines lie. */
  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands, private readonly box: () => TemplateRun["box"]) {
    part("pipeline-templates").replaceChildren(...TEMPLATES.map(({ key, label }) =>
      element("button", { type: "button", "data-template": key, onclick: () => this.add(key) }, label)));
    part("pipeline-add").addEventListener("click", () => this.offer(part("pipeline-templates").hidden));
    part("pipelines-list").addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || (part("pipeline-templates").hidden && this.removing === null)) return;
      // What it closes is not the drawer.
      event.preventDefault();
      event.stopPropagation();
      const name = this.removing;
      this.offer(false);
      this.ask(null);
      if (name === null) part("pipeline-add").focus();
      else this.focusRow(name, "remove");
    });
    const seen = (state: State): unknown[] =>
      [state.pipelines.known, state.pipelines.drafts, state.pipelines.open, whyNotSteering(state), state.hello === null, state.hello?.recording];
    store.watch(seen, () => this.show(), (a, b) => a.every((value, i) => Object.is(value, b[i])));
    store.watch((state) => state.pipelines.asked, (asked) => this.showOutcome(asked));
    // Costs change with every run of a pipeline: once a second is often enough to read.
    setInterval(() => this.showCosts(), 1000);
  }

  private show(): void {
    const { state } = this.store;
    const { known, drafts, open } = state.pipelines;
    const why = whyNotSteering(state);
    part("pipelines-panel").hidden = state.hello === null || state.hello.recording != null;
    part("pipelines-list").hidden = open !== null;
    part("pipelines-empty").hidden = known.length > 0;
    const add = part("pipeline-add") as HTMLButtonElement;
    add.hidden = open !== null;
    add.disabled = why !== "";
    add.title = why || "Add a pipeline";
    if (why !== "" || open !== null) this.offer(false);
    if (why !== "" || !known.some(({ name }) => name === this.removing)) this.removing = null;
    write(part("pipelines-who"), why === "" ? "" : `${why} Pipelines can be read.`);
    part("pipelines-who").hidden = why === "";
    const focused = document.activeElement as HTMLElement | null;
    const held = focused && this.list.contains(focused) ? { name: focused.closest("li")?.dataset.pipeline ?? "", act: focused.dataset.act ?? "load" } : null;
    const news = Object.entries(drafts).filter(([, draft]) => !known.some(({ name }) => name === draft.replaced));
    this.list.replaceChildren(...known.map((pipeline) => this.row(pipeline, drafts[keyOf(pipeline.name)], why)), ...news.map(([key, draft]) => this.draftRow(key, draft)));
    this.showCosts();
    if (held) this.focusRow(held.name, held.act);
  }

  private row(pipeline: Pipeline, draft: PipelineDraft | undefined, why: string): HTMLElement {
    const { name } = pipeline;
    if (this.removing === name) return this.question(name);
    const act = (kind: string, sign: string, label: string, run: () => void): HTMLElement => element("button", {
      type: "button", class: "icon", "data-act": kind, title: why || label, "aria-label": `${label} ${name}`, "aria-disabled": why !== "" ? "true" : "false",
      onclick: () => { if (whyNotSteering(this.store.state) === "") run(); },
    }, sign === "" ? copySign() : sign);
    return element("li", { "data-pipeline": name },
      element("button", { type: "button", class: "load", "data-act": "load", title: why === "" ? "Edit it" : "Read it", onclick: () => this.open(pipeline) },
        element("span", { class: "title" }, name, draft && isChanged(draft) ? element("span", { class: "chip" }, "draft") : null),
        element("span", { class: "detail", title: purpose(pipeline) }, purpose(pipeline)),
        element("span", { class: "detail cost" }, cadence(pipeline))),
      act("duplicate", "", "Duplicate", () => this.duplicate(pipeline)),
      act("remove", "×", "Remove", () => this.ask(name)));
  }

  /** Asks in place whether a pipeline is to be removed. */
  private question(name: string): HTMLElement {
    return element("li", { "data-pipeline": name, class: "question" },
      element("span", { class: "title" }, `Remove ${name}?`),
      element("button", { type: "button", class: "small", "data-act": "remove", "aria-label": `Remove ${name} now`, onclick: () => this.remove(name) }, "Remove"),
      element("button", { type: "button", class: "small", "data-act": "keep", "aria-label": `Keep ${name}`, onclick: () => { this.ask(null); this.focusRow(name, "remove"); } }, "Keep"));
  }

  private draftRow(key: string, { text }: PipelineDraft): HTMLElement {
    const name = /"name"\s*:\s*"([^"]+)"/.exec(text)?.[1] ?? "new pipeline";
    return element("li", { "data-pipeline": key },
      element("button", { type: "button", class: "load", "data-act": "load", title: "Go on writing it", onclick: () => this.store.dispatch({ type: "pipeline opened", key, replaced: null, text }) },
        element("span", { class: "title" }, name, element("span", { class: "chip" }, "draft")), element("span", { class: "detail" }, "not applied yet")),
      element("button", { type: "button", class: "icon", "data-act": "remove", title: "Discard the draft", "aria-label": `Discard the draft of ${name}`, onclick: () => this.store.dispatch({ type: "pipeline discarded", key }) }, "×"));
  }

  private showCosts(): void {
    if (part("pipelines-list").hidden) return;
    const { status, pipelines } = this.store.state;
    const costs = new Map(status?.pipelines?.map((cost) => [cost.name, cost]));
    for (const row of this.list.querySelectorAll<HTMLElement>("li")) {
      const pipeline = pipelines.known.find(({ name }) => name === row.dataset.pipeline);
      const cost = row.querySelector(".cost");
      if (pipeline && cost) write(cost, [cadence(pipeline), costText(costs.get(pipeline.name))].filter((said) => said !== "").join(" · "));
    }
  }

  private focusRow(name: string, act: string): void {
    const row = [...this.list.querySelectorAll<HTMLElement>("li")].find(({ dataset }) => dataset.pipeline === name);
    (row?.querySelector<HTMLElement>(`[data-act="${act}"]`) ?? this.list.querySelector<HTMLElement>("button") ?? part("pipeline-add")).focus();
  }

  private offer(shown: boolean): void {
    part("pipeline-templates").hidden = !shown;
    part("pipeline-add").setAttribute("aria-expanded", String(shown));
    if (shown) part("pipeline-templates").querySelector("button")?.focus();
  }

  private ask(name: string | null): void {
    if (this.removing === name) return;
    this.removing = name;
    this.show();
    if (name !== null) this.focusRow(name, "keep");
  }

  private open(pipeline: Pipeline): void {
    this.store.dispatch({ type: "pipeline opened", key: keyOf(pipeline.name), replaced: pipeline.name, text: textOf(pipeline) });
  }

  private add(key: string): void {
    const template = TEMPLATES.find((one) => one.key === key);
    const { hello } = this.store.state;
    if (!template || !hello) return;
    this.write(template.make({ fields: hello.fields, features: hello.features, box: this.box() }));
  }

  private duplicate(pipeline: Pipeline): void {
    this.write(pipeline);
  }

  /** Begins a new pipeline with what one of another name does. */
  private write(pipeline: Pipeline): void {
    const text = textOf({ ...pipeline, name: freeName(pipeline.name, this.store.state.pipelines.known) });
    this.store.dispatch({ type: "pipeline opened", key: newKey(this.store.state.pipelines.drafts), replaced: null, text });
  }

  private remove(name: string): void {
    this.removing = null;
    const id = this.commands.send({ pipelines: { remove: [name] } });
    if (id !== null) this.store.dispatch({ type: "pipelines asked", asked: { id, key: null, name, text: "" } });
    this.show();
    part("pipeline-add").focus();
  }

  /** Says what became of the change that was asked for last. */
  private showOutcome(asked: AskedChange | null): void {
    const shown = part("pipeline-outcome");
    shown.hidden = asked === null;
    if (!asked) return write(shown, "");
    shown.dataset.tone = asked.state === "applied" ? "good" : asked.state === "refused" || asked.state === "lost" ? "bad" : "warning";
    write(shown, outcomeText(asked));
  }
}

/** Two sheets, one over the other. */
function copySign(): SVGElement {
  const sign = svg("svg", { viewBox: "0 0 16 16", class: "sign", "aria-hidden": "true" });
  sign.append(svg("path", { d: "M5.5 5.5h7v7h-7zM3.5 10.5v-7h7" }));
  return sign;
}

/** What became of a change, in words. */
function outcomeText({ state, name, key, reason, cycle }: AskedChange): string {
  const what = key === null ? `${name} is ` : "";
  switch (state) {
    case "sent": return `${key === null ? `The removal of ${name}` : name} was sent to the run.`;
    case "accepted": return "The run has taken it, and tries it at its next step, on all ranks.";
    case "applied": return `${what === "" ? `${name}: applied` : `${what}removed`}${cycle === null ? "" : ` at cycle ${cycle}`}.`;
    case "refused": return `The run refused it: ${reason.replace(/^message:\d+:\d+: /, "").replaceAll("`", "")}`;
    case "lost": return "The connection was lost on the way: the list shows whether the run has made the change.";
  }
}
