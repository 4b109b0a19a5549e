/** Notes that are pinned to a place and a cycle: pins in the picture, a list that flies there, and a form for another one. */
import type { PinnedNote, Vector } from "../connection/protocol";
import { element, holdFocus, part, write } from "../dom";
import { digits } from "../number";
import type { Marks } from "../picture/marks";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { mayDrive } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { sameJson } from "../store/store";

/** The most characters beside a pin. */
const LABEL = 28;

export interface NotesPicture {
  /** Takes the camera close to a place. */
  flyTo(place: Vector): void;
  /** The place in the middle of the picture: of what is seen there, or that which the camera looks at. */
  middle(): Vector;
}

export class NotesPanel {
  /** Whether the next click in the picture is the place of a note. */
  choosing = false;
  private at: Vector | null = null;
  /** The note that was sent last: by the id of its message. */
  private sent: { id: string; text: string } | null = null;

  /** `reveal` opens the drawer that an element lies in. */
  constructor(
    private readonly store: Store<State, Action>, private readonly commands: Commands, private readonly marks: Marks,
    private readonly picture: NotesPicture, private readonly reveal: (target: HTMLElement) => void,
  ) {
    part("note-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.pin();
    });
    part("note-text").addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || event.shiftKey || event.isComposing) return;
      event.preventDefault();
      this.pin();
    });
    part("notes").addEventListener("click", (event) => {
      const button = (event.target as HTMLElement).closest("button");
      const number = Number(button?.closest("li")?.dataset.note);
      const note = store.state.notes.find((known) => known.number === number);
      if (!button || !note) return;
      if (button.dataset.act === "remove") commands.send({ remove_note: { number } });
      else {
        picture.flyTo(note.at);
        this.seek(note);
      }
    });
    store.watch((state) => [state.notes, mayDrive(state), state.hello?.recording != null] as const, ([notes, may, isRecording]) => this.show(notes, may, isRecording), sameJson);
    this.sayPlace();
  }

  /** Takes a recording to the cycle of a note. */
  private seek(note: PinnedNote): void {
    if (!this.store.state.hello?.recording || this.commands.ask({ play: { seek: { cycle: note.cycle } } }) === null) return;
    this.store.dispatch({ type: "note sought", note });
  }

  /** Begins to wait for a click in the picture, or waits no more. */
  toggle(): void {
    this.choosing = !this.choosing && mayDrive(this.store.state);
    part("note").setAttribute("aria-pressed", String(this.choosing));
  }

  /** Takes the place of a note that is to be written. */
  take(place: Vector): void {
    if (this.choosing) this.toggle();
    this.at = place;
    this.sayPlace();
    this.reveal(part("note-text"));
    part("note-text").focus();
  }

  /** Whether an error was about a note of this panel; its text is there again. */
  refused(id: string, reason: string): boolean {
    if (id !== this.sent?.id) return false;
    const text = part("note-text") as HTMLTextAreaElement;
    if (text.value === "") text.value = this.sent.text;
    this.say(reason);
    return true;
  }

  private pin(): void {
    const field = part("note-text") as HTMLTextAreaElement;
    const text = field.value.trim();
    if (text === "") return this.say("A note needs a text.");
    const { cycle } = this.store.state.frames;
    const id = this.commands.send({ note: { text, at: this.at ?? this.picture.middle(), ...(cycle === null ? {} : { cycle }) } });
    if (id === null) return;
    this.sent = { id, text };
    this.at = null;
    field.value = "";
    this.say("");
    this.sayPlace();
  }

  private say(problem: string): void {
    part("note-problem").hidden = problem === "";
    write(part("note-problem"), problem);
  }

  private sayPlace(): void {
    write(part("note-place"), this.at ? `at (${this.at.map((value) => digits(value, 3)).join(", ")})` : "in the middle of the picture");
  }

  private show(notes: readonly PinnedNote[], may: boolean, isRecording: boolean): void {
    if (!may && this.choosing) this.toggle();
    (part("note") as HTMLButtonElement).disabled = !may;
    part("notes-panel").hidden = !may && notes.length === 0;
    part("note-form").hidden = !may;
    const list = part("notes");
    const focusAgain = holdFocus(list, ({ dataset }) => dataset.note, () => part("note-text").focus());
    list.replaceChildren(...notes.map(({ number, text, cycle, by }) => element("li", { "data-note": number },
      element("button", { type: "button", class: "load", title: isRecording ? "Show its place, and go to its cycle" : "Show its place" },
        element("span", { class: "title" }, text), element("span", { class: "detail" }, element("bdi", {}, by), ` · cycle ${cycle}`)),
      may ? element("button", { type: "button", class: "icon", "data-act": "remove", "aria-label": `Remove the note of ${by}: ${short(text)}` }, "×") : null)));
    focusAgain();
    this.marks.set("notes", notes.map(({ text, at }) => ({ points: [at], label: short(text), kind: "note" as const })));
  }
}

/** As much of a text as goes beside a pin. */
function short(text: string): string {
  const line = text.replace(/\s+/g, " ");
  const characters = [...line];
  return characters.length > LABEL ? `${characters.slice(0, LABEL - 1).join("")}…` : line;
}
