/** The editor of one pipeline: its text with the checker's marks, what stands at the cursor, and what the run says to it. */
import type { Json } from "../connection/protocol";
import { element, holdFocus, part, write } from "../dom";
import type { Checker } from "../pipelines/checker";
import type { PipelineEditor } from "../pipelines/editor";
import { markOf, refusalMark } from "../pipelines/marks";
import type { Mark } from "../pipelines/marks";
import { namesAt, namesOf, readsDescribed } from "../pipelines/names";
import { placeAt, readSoFar } from "../pipelines/place";
import type { Path } from "../pipelines/place";
import { descriptionAt } from "../pipelines/suggestions";
import type { KnownNames } from "../pipelines/suggestions";
import { unknownNames } from "../pipelines/unknown-names";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { changeOf, isChanged, openDraft } from "../store/pipeline-drafts";
import type { PipelineDraft } from "../store/pipeline-drafts";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

/** How long a hand must rest before its text is checked, in milliseconds. */
const REST = 150;

/** What the editor is made of; each is loaded when it is first needed. */
export interface EditorParts {
  schema(): Promise<Json>;
  /** The module with the editor. */
  load(): Promise<{ PipelineEditor: typeof PipelineEditor }>;
  checker: Checker;
}

export class PipelineEditorPanel {
  private editor: PipelineEditor | null = null;
  private loading: Promise<void> | null = null;
  private schema: Json = {};
  private timer: ReturnType<typeof setTimeout> | undefined;
  private marks: readonly Mark[] = [];
  private shownKey: string | null = null;
  /** Why texts are not checked here; empty where they are. */
  private unchecked = "";

  /** `reveal` opens the drawer that an element lies in. */
  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands, private readonly parts: EditorParts, private readonly reveal: (target: HTMLElement) => void) {
    part("pipeline-apply").addEventListener("click", () => this.apply());
    part("pipeline-close").addEventListener("click", () => this.leave());
    part("pipeline-revert").addEventListener("click", () => {
      const draft = openDraft(store.state.pipelines);
      if (draft) store.dispatch({ type: "pipeline written", text: draft.began });
      this.editor?.focus();
    });
    part("pipeline-editor").addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || event.defaultPrevented) return;
      event.preventDefault();
      event.stopPropagation();
      this.leave();
    });
    const seen = (state: State): unknown[] =>
      [state.pipelines.open, openDraft(state.pipelines), whyNotSteering(state), state.pipelines.asked, state.pipelines.known];
    store.watch(seen, () => this.show(), (a, b) => a.every((value, i) => Object.is(value, b[i])));
    store.watch(({ hello }) => [hello?.channel, hello?.fields, hello?.features.map(({ name }) => name)], () => this.show(), sameJson);
    // What a pipeline must go with has changed.
    store.watch((state) => [state.pipelines.known, state.hello?.parameters.map(({ name }) => name)] as const, () => this.check(), sameJson);
  }

  private show(): void {
    const { state } = this.store;
    const { open, asked } = state.pipelines;
    const draft = openDraft(state.pipelines);
    part("pipeline-editor").hidden = draft === null;
    document.body.dataset.writing = String(draft !== null);
    const wasShown = this.shownKey;
    this.shownKey = open;
    if (!draft) {
      clearTimeout(this.timer);
      return;
    }
    const why = whyNotSteering(state);
    write(part("pipeline-title"), draft.replaced ?? "New pipeline");
    const isWaiting = asked !== null && asked.key === open && (asked.state === "sent" || asked.state === "accepted");
    const errors = draft.checked?.errors ?? [];
    const isRefused = asked !== null && asked.key === open && asked.state === "refused" && asked.text === draft.text;
    const refusal = isRefused ? refusalMark(draft.text, asked.reason) : null;
    const warnings = this.warnings(draft).filter(({ from, to }) => !refusal || to <= refusal.from || from >= refusal.to);
    this.marks = [...errors.map((error) => markOf(draft.text, error)), ...(refusal ? [refusal] : []), ...warnings];
    this.showMarks(refusal, draft.checked?.more ?? 0);
    const apply = part("pipeline-apply") as HTMLButtonElement;
    const isNew = draft.replaced === null;
    const whyNot = why !== "" ? why : errors.length > 0 ? "There are errors in it." : draft.checked === null ? "It is being checked." : isWaiting ? "The run has not answered yet." : !isNew && !isChanged(draft) ? "Nothing is changed." : "";
    apply.disabled = whyNot !== "";
    apply.title = whyNot || "Ctrl+Enter";
    (part("pipeline-revert") as HTMLButtonElement).disabled = !isChanged(draft);
    write(part("pipeline-state"), this.stateText(draft.checked !== null, errors.length + (draft.checked?.more ?? 0), warnings.length, why === "" && isRefused ? "Refused by the run." : why));
    part("pipeline-state").dataset.tone = errors.length > 0 || isRefused ? "bad" : warnings.length > 0 ? "warning" : "good";
    if (this.editor) {
      this.editor.show(draft.text, why !== "");
      this.editor.mark(this.marks);
    }
    if (wasShown === open) {
      if (draft.checked === null) this.check();
      return;
    }
    this.check();
    void this.begin();
  }

  /** Names that nobody seems to have. What the run has taken needs no warning, and where there are errors what is missing may be what could not be read. */
  private warnings(draft: PipelineDraft): Mark[] {
    const { state } = this.store;
    const isNews = draft.replaced === null || isChanged(draft);
    if (draft.checked?.errors.length !== 0 || this.unchecked !== "" || !isNews || !readsDescribed(state, readSoFar(draft.text))) return [];
    return unknownNames(draft.text, namesOf(state));
  }

  private stateText(isChecked: boolean, errors: number, warnings: number, why: string): string {
    if (why !== "") return why;
    if (!isChecked) return "Checking…";
    if (this.unchecked !== "") return `Not checked here (${this.unchecked}): the run checks it.`;
    const ofWarnings = warnings === 0 ? "" : warnings === 1 ? ", 1 warning" : `, ${warnings} warnings`;
    return `${errors === 0 ? "No errors" : errors === 1 ? "1 error" : `${errors} errors`}${ofWarnings}.`;
  }

  /** Lists what is marked; `refusal` is what the run has said. */
  private showMarks(refusal: Mark | null, more: number): void {
    const list = part("pipeline-errors");
    const focusAgain = holdFocus(list, (row) => row.querySelector(".title")?.textContent, () => this.editor?.focus());
    list.hidden = this.marks.length === 0;
    list.replaceChildren(...this.marks.map((mark) => element("li", mark.isWarning ? { class: "warning" } : {},
      element("button", { type: "button", class: "load", title: "Go there", onclick: () => this.editor?.goTo(mark.from, mark.to) },
        element("span", { class: "detail" }, `line ${mark.line}${mark === refusal ? " · the run" : mark.isWarning ? " · warning" : ""}`), element("span", { class: "title" }, mark.text)),
      mark.fix ? element("button", { type: "button", class: "small", "data-act": "fix", onclick: () => this.editor?.replace(mark.from, mark.to, mark.fix!.insert) }, `Use ${mark.fix.name}`) : null)),
    ...(more > 0 ? [element("li", { class: "hint" }, `and ${more} more`)] : []));
    focusAgain();
  }

  /** Loads the editor where it is not there, and takes the cursor into it. */
  private async begin(): Promise<void> {
    part("pipeline-editor").scrollIntoView({ block: "nearest" });
    try {
      await (this.loading ??= this.load());
    } catch (error) {
      this.loading = null;
      write(part("pipeline-state"), `The editor did not arrive: ${error instanceof Error ? error.message : String(error)}.`);
      return;
    }
    const draft = openDraft(this.store.state.pipelines);
    if (!draft || !this.editor) return;
    this.editor.show(draft.text, whyNotSteering(this.store.state) !== "");
    this.editor.mark(this.marks);
    this.reveal(part("pipeline-editor"));
    part("pipeline-editor").scrollIntoView({ block: "nearest" });
    this.editor.focus();
    this.describe(0);
  }

  private async load(): Promise<void> {
    const [{ PipelineEditor }, schema] = await Promise.all([this.parts.load(), this.parts.schema()]);
    this.schema = schema;
    this.editor = new PipelineEditor(part("pipeline-text"), "the pipeline as JSON", {
      schema: () => this.schema, names: (path) => this.names(path),
      written: (text) => this.store.dispatch({ type: "pipeline written", text }),
      moved: (offset) => this.describe(offset), apply: () => this.apply(), leave: () => this.leave(),
    });
  }

  /** The names that may be written at a path of the text. */
  private names(path: Path): KnownNames {
    const { state } = this.store;
    const draft = openDraft(state.pipelines);
    return namesAt(namesOf(state), readSoFar(draft?.text ?? ""), draft?.replaced ?? null, path);
  }

  /** Says what stands at the cursor. */
  private describe(offset: number): void {
    const draft = openDraft(this.store.state.pipelines);
    const about = part("pipeline-about");
    const place = draft && placeAt(draft.text, offset);
    if (!draft || !place) return write(about, "");
    const key = place.part === "key" ? draft.text.slice(place.from, place.to).replaceAll('"', "") : null;
    const path = key === null ? place.path : [...place.path, key];
    const named = path.findLast((step) => typeof step === "string");
    const end = path.findLastIndex((step) => typeof step === "string");
    const text = descriptionAt(this.schema, path.slice(0, end + 1));
    write(about, named === undefined || text === "" ? "" : `${named}: ${text}`);
  }

  /** Has the text checked once the hand rests. */
  private check(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const { pipelines: { open, known }, hello } = this.store.state;
      const draft = openDraft(this.store.state.pipelines);
      if (open === null || !draft) return;
      const { text } = draft;
      const replaced = known.some(({ name }) => name === draft.replaced) ? draft.replaced : null;
      this.parts.checker.check({ text, replaced, pipelines: known, parameters: hello?.parameters.map(({ name }) => name) ?? [] }, (answer) => {
        this.unchecked = "failure" in answer ? answer.failure : "";
        const { errors, more } = "failure" in answer ? { errors: [], more: 0 } : answer;
        this.store.dispatch({ type: "pipeline checked", key: open, text, errors, more });
      });
    }, REST);
  }

  private apply(): void {
    const { pipelines } = this.store.state;
    const draft = openDraft(pipelines);
    if (!draft || (part("pipeline-apply") as HTMLButtonElement).disabled) return;
    const wanted = changeOf(draft, pipelines.known);
    const id = wanted && this.commands.send({ pipelines: wanted.change });
    if (wanted && id !== null) this.store.dispatch({ type: "pipelines asked", asked: { id, key: pipelines.open, name: wanted.name, text: draft.text } });
    // A disabled button loses the focus.
    if (document.activeElement === part("pipeline-apply") || document.activeElement === document.body) this.editor?.focus();
  }

  /** Back to the list; what was written is kept. */
  private leave(): void {
    const { open, drafts } = this.store.state.pipelines;
    if (open === null) return;
    const name = drafts[open]?.replaced ?? open;
    this.store.dispatch({ type: "pipeline left" });
    const row = [...part("pipelines").querySelectorAll<HTMLElement>("li")].find(({ dataset }) => dataset.pipeline === name);
    (row?.querySelector<HTMLElement>("button") ?? part("pipeline-add")).focus();
  }
}
