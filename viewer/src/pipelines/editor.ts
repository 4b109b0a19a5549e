/**
 * The text of a pipeline in an editor, CodeMirror: with colours, completion, and marks under what is wrong. It is loaded when it is
 * first needed.
 */
import { autocompletion, closeBrackets, closeBracketsKeymap, completionKeymap, startCompletion } from "@codemirror/autocomplete";
import type { Completion, CompletionContext, CompletionResult } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { json } from "@codemirror/lang-json";
import { HighlightStyle, bracketMatching, syntaxHighlighting } from "@codemirror/language";
import { lintGutter, nextDiagnostic, previousDiagnostic, setDiagnostics } from "@codemirror/lint";
import { Compartment, EditorState, Prec } from "@codemirror/state";
import { EditorView, drawSelection, highlightActiveLine, keymap, lineNumbers } from "@codemirror/view";
import { tags } from "@lezer/highlight";
import type { Json } from "../connection/protocol";
import type { Mark } from "./marks";
import { isFormula, isMessage } from "./formula";
import { placeAt } from "./place";
import type { Path } from "./place";
import { formulaNames, suggestionsAt } from "./suggestions";
import type { KnownNames, Suggestion } from "./suggestions";

/** What the editor asks, and whom it tells. */
export interface Surroundings {
  schema(): Json;
  /** The names that may be written at a path. */
  names(path: Path): KnownNames;
  written(text: string): void;
  /** The cursor is elsewhere. */
  moved(offset: number): void;
  apply(): void;
  leave(): void;
}

const COLOURS = HighlightStyle.define([
  { tag: tags.propertyName, color: "var(--text)" },
  { tag: tags.string, color: "var(--good-text)" },
  { tag: tags.number, color: "var(--fixed)" },
  { tag: [tags.bool, tags.null], color: "var(--pressed)" },
  { tag: [tags.separator, tags.punctuation, tags.brace, tags.squareBracket], color: "var(--soft)" },
  { tag: tags.invalid, color: "var(--bad-text)" },
]);

const THEME = EditorView.theme({
  "&": { color: "var(--text)", backgroundColor: "var(--field)", fontSize: "12px", border: "1px solid var(--line-strong)", borderRadius: "5px" },
  "&.cm-focused": { outline: "2px solid var(--accent)", outlineOffset: "1px" },
  ".cm-scroller": { fontFamily: '"DejaVu Sans Mono", "Cascadia Mono", Menlo, Consolas, monospace', lineHeight: "1.5" },
  ".cm-content": { caretColor: "var(--text)", padding: "6px 0" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  ".cm-gutters": { backgroundColor: "var(--panel)", color: "var(--faint)", border: "0" },
  ".cm-activeLine": { backgroundColor: "transparent" },
  "&.cm-focused .cm-activeLine": { backgroundColor: "color-mix(in srgb, var(--hover) 45%, transparent)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": { backgroundColor: "color-mix(in srgb, var(--fixed) 35%, transparent)" },
  "&.cm-focused .cm-matchingBracket": { backgroundColor: "var(--hover)", outline: "1px solid var(--line-strong)" },
  ".cm-tooltip": { backgroundColor: "var(--panel)", color: "var(--text)", border: "1px solid var(--line-strong)", borderRadius: "5px", boxShadow: "0 4px 18px #0006" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul": { fontFamily: "inherit", maxHeight: "15em" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul > li": { padding: "4px 8px", minHeight: "24px" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul > li[aria-selected]": { backgroundColor: "var(--hover)", color: "var(--text)" },
  ".cm-completionMatchedText": { textDecoration: "none", fontWeight: "700" },
  ".cm-completionDetail": { color: "var(--soft)", fontStyle: "normal" },
  ".cm-tooltip.cm-completionInfo": { padding: "6px 9px", maxWidth: "280px", lineHeight: "1.4" },
  ".cm-diagnostic": { padding: "5px 9px", maxWidth: "340px" },
  ".cm-diagnostic-error": { borderLeftColor: "var(--bad)" },
  ".cm-lint-marker-error": { content: "normal", backgroundColor: "var(--bad)", borderRadius: "50%" },
  ".cm-lint-marker-warning": { content: "normal", backgroundColor: "var(--low)", clipPath: "polygon(50% 0, 100% 100%, 0 100%)" },
  ".cm-diagnostic-warning": { borderLeftColor: "var(--low)" },
  ".cm-diagnosticAction": { backgroundColor: "var(--raised)", color: "var(--text)", border: "1px solid var(--line)", minHeight: "24px" },
  ".cm-lintRange-error": { backgroundImage: "none", textDecoration: "underline wavy var(--bad) 1.5px", textUnderlineOffset: "3px" },
  ".cm-lintRange-warning": { backgroundImage: "none", textDecoration: "underline wavy var(--low) 1.5px", textUnderlineOffset: "3px" },
});

/** Puts a suggestion in place of what was begun, and the cursor where one goes on. */
function take(view: EditorView, { insert }: Suggestion): void {
  const place = placeAt(view.state.doc.toString(), view.state.selection.main.head);
  if (!place) return;
  const cursor = insert.indexOf("#");
  const text = insert.replace("#", "");
  const behind = view.state.doc.sliceString(place.to).trimStart();
  const comma = behind === "" || /^[}\],:]/.test(behind) ? "" : ",";
  view.dispatch({
    changes: { from: place.from, to: place.to, insert: text + comma }, selection: { anchor: place.from + (cursor < 0 ? text.length : cursor) },
    userEvent: "input.complete", scrollIntoView: true,
  });
  // Between brackets or quotes there is more to choose.
  if (cursor >= 0 && cursor < text.length) startCompletion(view);
}

export class PipelineEditor {
  private readonly view: EditorView;
  private readonly readOnly = new Compartment();
  private quiet = false;

  constructor(parent: HTMLElement, label: string, private readonly surroundings: Surroundings) {
    const key = (run: () => void) => () => {
      run();
      return true;
    };
    this.view = new EditorView({
      parent,
      state: EditorState.create({
        extensions: [
          lineNumbers(), history(), drawSelection(), bracketMatching(), closeBrackets(), highlightActiveLine(), json(), syntaxHighlighting(COLOURS), THEME,
          EditorView.lineWrapping, EditorState.tabSize.of(2), lintGutter(),
          autocompletion({ override: [(context) => this.complete(context)], icons: false, closeOnBlur: true }),
          this.readOnly.of(EditorState.readOnly.of(false)),
          EditorView.contentAttributes.of({ "aria-label": label, "aria-describedby": "pipeline-keys" }),
          Prec.high(keymap.of([{ key: "Mod-Enter", run: key(() => surroundings.apply()), stopPropagation: true }])),
          // Behind those of the completion: the first Escape closes its list.
          keymap.of([
            ...completionKeymap, ...closeBracketsKeymap, ...historyKeymap, { key: "F8", run: nextDiagnostic }, { key: "Shift-F8", run: previousDiagnostic },
            { key: "Escape", run: key(() => surroundings.leave()), stopPropagation: true },
            // Tab leaves the editor.
            ...defaultKeymap.filter(({ key: bound }) => bound !== "Tab" && bound !== "Mod-Enter" && bound !== "Escape"),
          ]),
          EditorView.updateListener.of((update) => {
            if (update.docChanged && !this.quiet) surroundings.written(update.state.doc.toString());
            if (update.docChanged || update.selectionSet) surroundings.moved(update.state.selection.main.head);
          }),
        ],
      }),
    });
  }

  /** Shows a text that was not typed here. */
  show(text: string, isReadOnly: boolean): void {
    const { state } = this.view;
    this.view.dispatch({ effects: this.readOnly.reconfigure(EditorState.readOnly.of(isReadOnly)) });
    if (state.doc.toString() === text) return;
    this.quiet = true;
    this.view.dispatch({ changes: { from: 0, to: state.doc.length, insert: text }, selection: { anchor: Math.min(state.selection.main.head, text.length) } });
    this.quiet = false;
  }

  mark(marks: readonly Mark[]): void {
    const { state } = this.view;
    this.view.dispatch(setDiagnostics(state, marks.filter(({ to }) => to <= state.doc.length).map(({ from, to, text, fix, isWarning }) => ({
      from, to, severity: isWarning ? "warning" as const : "error" as const, message: text, actions: fix ? [{ name: `Use ${fix.name}`, apply: () => this.replace(from, to, fix.insert) }] : [],
    }))));
  }

  /** Puts a text in place of another, as if it had been typed. */
  replace(from: number, to: number, insert: string): void {
    this.view.dispatch({ changes: { from, to, insert }, selection: { anchor: from + insert.length }, userEvent: "input.complete", scrollIntoView: true });
    this.focus();
  }

  /** Shows a part of the text and chooses it. */
  goTo(from: number, to: number): void {
    this.view.dispatch({ selection: { anchor: from, head: to }, scrollIntoView: true });
    this.focus();
  }

  focus(): void {
    this.view.focus();
  }

  private complete(context: CompletionContext): CompletionResult | null {
    const text = context.state.doc.toString();
    const place = placeAt(text, context.pos);
    if (!place || context.state.readOnly) return null;
    const token = text.slice(place.from, place.to);
    if (token === "" && !context.explicit) return null;
    if (place.part === "value" && token.startsWith('"') && (isFormula(place.path) || isMessage(place.path))) return this.inFormula(context, place.path);
    const suggestions = suggestionsAt(this.surroundings.schema(), place, this.surroundings.names(place.path));
    const from = place.from + (token.startsWith('"') ? 1 : 0);
    return { from, options: suggestions.map((suggestion, index) => option(suggestion, (view) => take(view, suggestion), index)), validFor: /^[^"]*$/ };
  }

  /** The names that begin with what stands before the cursor: a word, or in a line of the log and where one was opened a brace. */
  private inFormula(context: CompletionContext, path: Path): CompletionResult | null {
    const inBraces = context.matchBefore(/\{[^{}"]*/);
    const word = inBraces ?? (isMessage(path) ? null : context.matchBefore(/[A-Za-z_][\w.]*/));
    if (!word && (isMessage(path) || !context.explicit)) return null;
    const isClosed = context.state.doc.sliceString(context.pos, context.pos + 1) === "}";
    const options = formulaNames(path, this.surroundings.names(path)).map((suggestion, index) => ({
      ...option(suggestion, undefined, index), apply: inBraces ? `${suggestion.label}${isClosed ? "" : "}"}` : suggestion.insert,
    }));
    return { from: inBraces ? inBraces.from + 1 : word?.from ?? context.pos, options };
  }
}

function option({ label, detail, description }: Suggestion, apply: ((view: EditorView) => void) | undefined, index: number): Completion {
  return { label, detail, ...(description === "" ? {} : { info: description }), ...(apply ? { apply } : {}), boost: -Math.min(index, 99) };
}

