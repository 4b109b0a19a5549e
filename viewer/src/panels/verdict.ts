/** The foot of the form, always in sight: preview and forecast in a line each, what helps where they say no, Apply and Cancel. */
import type { Vector } from "../connection/protocol";
import { part, write } from "../dom";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import type { Values } from "../form/schema";
import { asksNothing, isDivisible, isObject, sameFields, wholeOf } from "../store/draft";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";
import { applyButton, floored, forecastLine, openBoundaryWarning, percent, previewLine, remedies } from "../store/verdict";
import type { Line } from "../store/verdict";

export class VerdictPanel {
  private readonly slider = part("amount") as HTMLInputElement;
  /** The part of the whole amount up to which the forecast has let it pass. */
  private limit = 1;
  /** What `limit` is of: the whole amount, and all else that a forecast depends on. */
  private limited: { whole: Values; rest: readonly unknown[] } | null = null;

  /** `show` takes the camera to a place. `focusProblem` puts the focus where something is wrong. */
  constructor(
    private readonly store: Store<State, Action>, private readonly commands: Commands,
    private readonly show: (place: Vector) => void, private readonly focusProblem: () => void,
  ) {
    store.watch((state) => state, (state) => this.refresh(state));
    part("edit").addEventListener("submit", (event) => {
      event.preventDefault();
      this.apply();
    });
    part("cancel").addEventListener("click", () => store.dispatch({ type: "cleared" }));
    part("apply-part").addEventListener("click", () => this.fillIn());
    part("untangle").addEventListener("click", () => this.untangle());
    part("show-worst").addEventListener("click", () => {
      const worst = remedies(store.state)?.worst;
      if (worst) this.show(worst);
    });
    this.slider.addEventListener("input", () => this.slide(Number(this.slider.value) / 100));
  }

  private apply(): void {
    const { why } = applyButton(this.store.state);
    if (why !== "") return;
    const problem = this.commands.apply();
    write(part("problem"), problem);
    part("problem").hidden = problem === "";
    if (problem !== "") this.focusProblem();
  }

  private refresh(state: State): void {
    const lines: [string, Line][] = [["preview", previewLine(state)], ["forecast", forecastLine(state)]];
    const details: string[] = [];
    for (const [id, { tone, text, details: more }] of lines) {
      const shown = part(id);
      shown.hidden = text === "";
      shown.dataset.tone = tone;
      write(shown, text);
      if (more !== "") details.push(more);
    }
    part("verdict-details").hidden = details.length === 0;
    write(part("verdict-reasons"), details.join("\n"));

    const warning = openBoundaryWarning(state);
    part("open-moved").hidden = warning === "";
    write(part("open-moved"), warning);

    const { label, why, isAnyway } = applyButton(state);
    const button = part("apply") as HTMLButtonElement;
    button.disabled = why !== "";
    button.title = why;
    button.dataset.anyway = String(isAnyway);
    write(button, label);
    const isComposing = !asksNothing(state) || state.draft.updating !== null || state.draft.problems.length > 0;
    part("cancel").hidden = !isComposing;

    const ways = remedies(state);
    part("remedies").hidden = ways === null;
    part("apply-part").hidden = !ways?.fraction;
    if (ways?.fraction) write(part("apply-part"), `Apply ${percent(this.allowed(state))}`);
    part("untangle").hidden = !ways?.untangle;
    part("show-worst").hidden = !ways?.worst;

    const refusal = part("refusal");
    refusal.hidden = state.refusal === "";
    write(refusal, state.refusal);
    if (asksNothing(state) || state.draft.problems.length === 0) {
      if (!part("problem").hidden && state.draft !== this.seen) part("problem").hidden = true;
    }
    this.seen = state.draft;
    this.showAmount(state);
  }

  private seen: State["draft"] | null = null;

  /** The part of the whole amount that would pass, as far as is known. */
  private allowed(state: State): number {
    const { answer } = state.forecast;
    const now = state.draft.amount?.fraction ?? 1;
    return answer?.outcome === "rejected" && typeof answer.fraction === "number" ? Math.min(1, now * answer.fraction) : this.limit;
  }

  private showAmount(state: State): void {
    const { amount } = state.draft;
    const whole = wholeOf(state);
    const { key, updating, settings, remedy } = state.draft;
    const rest = [key, updating, settings, remedy, state.selection.parts, state.hello?.stack];
    const isSame = this.limited !== null && sameFields(whole, this.limited.whole) && rest.every((value, i) => sameJson(value, this.limited!.rest[i]));
    if (!isSame) this.limit = 1;
    this.limited = { whole, rest };
    this.limit = Math.min(this.limit, this.allowed(state));
    const shown = (amount !== null || state.draft.updating !== null || !asksNothing(state)) && state.draft.problems.length === 0 && isDivisible(state);
    part("amount-row").hidden = !shown;
    const fraction = amount?.fraction ?? 1;
    // Rounded down, so that what is shown is no more than what passes.
    const percentShown = Math.floor(100 * fraction + 1e-9);
    if (document.activeElement !== this.slider || Math.abs(Number(this.slider.value) / 100 - fraction) > 0.005) this.slider.value = String(percentShown);
    const limit = this.limit < 1 ? ` of ${percent(this.limit)}` : "";
    write(part("amount-text"), `${percentShown} %${limit}`);
    part("amount-row").title = limit === "" ? "How much of it is asked for" : `${percent(this.limit)} of it would pass`;
    this.slider.style.setProperty("--feasible", `${100 * this.limit}%`);
  }

  /** Moves the amount; beyond what passes it stops. */
  private slide(wanted: number): void {
    const fraction = Math.min(wanted, floored(this.limit));
    if (fraction < wanted) this.slider.value = String(Math.floor(100 * fraction));
    this.store.dispatch({ type: "amount", fraction });
  }

  private fillIn(): void {
    this.store.dispatch({ type: "amount", fraction: floored(this.allowed(this.store.state)) });
    part("apply").focus();
  }

  /** Asks for the mending of what the guard refuses, for this order alone. */
  private untangle(): void {
    const { settings } = this.store.state.draft;
    const defaults = this.store.state.hello?.defaults.guard;
    const guard = isObject(settings.guard) ? settings.guard : isObject(defaults) ? defaults : {};
    this.store.dispatch({ type: "remedy", settings: { guard: { ...guard, otherwise: "untangle" } } });
  }
}
