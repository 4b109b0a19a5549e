// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { PipelineEditorPanel } from "../../src/panels/pipeline-editor";
import { PipelinesPanel } from "../../src/panels/pipelines";
import { Checker } from "../../src/pipelines/checker";
import type { CheckAnswer, CheckWorker } from "../../src/pipelines/checker";
import { namesAt, namesOf } from "../../src/pipelines/names";
import type { PipelineQuestion } from "../../src/kernel/language";
import { keyOf, readDrafts } from "../../src/store/pipeline-drafts";
import type { Pipeline } from "../../src/store/pipelines";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

const cut: Pipeline = { name: "cut", every: { steps: 5 }, stages: [{ slice: { origin: [1, 0, 0], normal: [1, 0, 0] } }, { stream: {} }] };
const health: Pipeline = { name: "health", stages: [{ quality: {} }] };

/** A worker that finds what `find` finds. */
function worker(find: (question: PipelineQuestion) => CheckAnswer): CheckWorker {
  const made: CheckWorker = { onmessage: null, onerror: null, terminate: () => undefined, postMessage: (question) => made.onmessage?.({ data: find(question as PipelineQuestion) } as MessageEvent<CheckAnswer>) };
  return made;
}

/** Stands in for the editor, which needs a browser. */
class FakeEditor {
  static made: FakeEditor;
  shown: [string, boolean] = ["", false];
  marks: readonly { text: string }[] = [];
  replace = vi.fn();
  goTo = vi.fn();
  constructor(_: HTMLElement, __: string, readonly surroundings: { written(text: string): void; apply(): void; leave(): void }) { FakeEditor.made = this; }
  show(text: string, isReadOnly: boolean): void { this.shown = [text, isReadOnly]; }
  mark(marks: readonly { text: string }[]): void { this.marks = marks; }
  focus(): void { document.getElementById("pipeline-close")!.focus(); }
}

describe("the pipelines of a run", () => {
  let made: ReturnType<typeof page>;
  let asked: PipelineQuestion[];
  let answer: CheckAnswer;
  const at = <T extends HTMLElement = HTMLButtonElement>(id: string): T => document.getElementById(id) as T;
  const row = (name: string): HTMLElement => [...document.querySelectorAll<HTMLElement>("#pipelines li")].find(({ dataset }) => dataset.pipeline === name)!;
  const act = (name: string, kind: string): HTMLElement => row(name).querySelector<HTMLElement>(`[data-act="${kind}"]`)!;
  const last = (): { id: string; [key: string]: unknown } => made.sent.at(-1) as never;
  const outcome = (status: "accepted" | "applied", id = last().id): void => made.store.dispatch({ type: "pipelines outcome", change: { id, status, cycle: 130 } });
  const known = (...pipelines: Pipeline[]): void => made.store.dispatch({ type: "pipelines known", pipelines });
  const settle = async (): Promise<void> => { await vi.advanceTimersByTimeAsync(200); };
  const draft = () => made.store.state.pipelines.drafts[made.store.state.pipelines.open ?? ""];

  beforeEach(() => {
    vi.useFakeTimers();
    Element.prototype.scrollIntoView = () => undefined;
    openDocument();
    made = page({ fields: [{ name: "pressure", association: "vertex", components: 1, unit: "Pa" }], monitors: [{ pipeline: "health", name: "quality.min" }] });
    [asked, answer] = [[], { errors: [], more: 0 }];
    new PipelinesPanel(made.store, made.commands, () => null);
    new PipelineEditorPanel(made.store, made.commands, {
      schema: () => Promise.resolve({}), load: () => Promise.resolve({ PipelineEditor: FakeEditor as never }),
      checker: new Checker(() => worker((question) => {
        asked.push(question);
        return answer;
      })),
    }, () => undefined);
    known(cut, health);
    return () => vi.useRealTimers();
  });

  it("are listed with what they do, when, and what that costs", async () => {
    made.store.dispatch({ type: "status", status: { ...STATUS, pipelines: [{ name: "cut", runs: 2, seconds: 0.004, bytes: 3000, memory: 0, every: 1 }] }, at: 0 });
    await vi.advanceTimersByTimeAsync(1000);
    expect([...row("cut").querySelectorAll(".title, .detail")].map(({ textContent }) => textContent)).toEqual(["cut", "slice across x at 1 → streamed", "every 5 steps · 2\u00a0ms, 1.5\u00a0kB a run"]);
    expect(namesAt(namesOf(made.store.state), {}, null, ["when"])).toMatchObject({ features: ["inlet", "outlet", "wall", "throat"], monitors: ["quality.min"] });
  });

  it("are read by one who watches, and changed by nobody else than the one who steers", async () => {
    made.greet({ role: "watcher", may_drive: false });
    expect(at("pipeline-add").disabled).toBe(true);
    expect(at("pipelines-who").textContent).toBe("This link is for watching only. Pipelines can be read.");
    for (const kind of ["duplicate", "remove"]) {
      expect(act("cut", kind).getAttribute("aria-disabled")).toBe("true");
      act("cut", kind).click();
    }
    expect([made.store.state.pipelines.open, row("cut").classList.contains("question")]).toEqual([null, false]);
    act("cut", "load").click();
    await settle();
    expect(FakeEditor.made.shown[1]).toBe(true);
    FakeEditor.made.surroundings.apply();
    expect([at("pipeline-apply").disabled, made.sent.length]).toEqual([true, 0]);
  });

  it("are changed in the editor once they are without errors", async () => {
    act("cut", "load").click();
    await settle();
    expect([at("pipelines-list").hidden, at("pipeline-title").textContent, at("pipeline-apply").disabled]).toEqual([true, "cut", true]);
    answer = { errors: [{ line: 1, column: 2, path: "nmae", message: "found the unknown key `nmae`", suggestion: "name" }], more: 0 };
    FakeEditor.made.surroundings.written('{"nmae": "cut"}');
    await settle();
    expect(asked.at(-1)).toEqual({ text: '{"nmae": "cut"}', replaced: "cut", pipelines: [cut, health], parameters: [] });
    expect([at("pipeline-apply").disabled, at("pipeline-state").textContent, FakeEditor.made.marks.length]).toEqual([true, "1 error.", 1]);
    document.querySelector<HTMLElement>('#pipeline-errors [data-act="fix"]')!.click();
    expect(FakeEditor.made.replace).toHaveBeenCalledWith(1, 7, '"name"');
    answer = { errors: [], more: 0 };
    const text = '{"name": "cut", "stages": []}';
    FakeEditor.made.surroundings.written(text);
    await settle();
    FakeEditor.made.surroundings.apply();
    expect(last()).toMatchObject({ pipelines: { set: [{ name: "cut", stages: [] }] } });
    outcome("accepted");
    expect(at("pipeline-outcome").textContent).toMatch(/^The run has taken it/);
    outcome("applied");
    known({ name: "cut", stages: [] }, health);
    expect([at("pipeline-outcome").textContent, at("pipeline-apply").disabled, made.store.state.pipelines.open]).toEqual(["cut: applied at cycle 130.", true, keyOf("cut")]);
  });

  it("keep the focus on an error while others come and go, and leave it to the text once there is none", async () => {
    act("cut", "load").click();
    await settle();
    const find = async (...names: string[]): Promise<void> => {
      const text = JSON.stringify({ name: "cut", ...Object.fromEntries(names.map((name) => [name, 1])) });
      answer = { errors: names.map((name) => ({ line: 1, column: 2, path: name, message: `found the unknown key \`${name}\``, suggestion: null })), more: 0 };
      FakeEditor.made.surroundings.written(text);
      await settle();
    };
    const button = (row: number): HTMLElement => document.querySelectorAll<HTMLElement>("#pipeline-errors .load")[row]!;
    await find("a", "b");
    button(1).focus();
    made.greet({ fields: [{ name: "speed", association: "vertex", components: 1 }] });
    expect(document.activeElement).toBe(button(1));
    known(cut);
    expect(document.activeElement).toBe(button(1));
    answer = { errors: [], more: 0 };
    known(cut, health);
    await settle();
    expect(document.activeElement).toBe(at("pipeline-close"));
  });

  it("are warned of where they name what nobody has, and can be applied all the same", async () => {
    act("health", "load").click();
    await settle();
    const state = () => [at("pipeline-state").textContent, at("pipeline-state").dataset.tone, at("pipeline-apply").disabled, FakeEditor.made.marks.length];
    const write = async (field: string, more = ""): Promise<void> => {
      FakeEditor.made.surroundings.written(`{"name": "health", ${more}"stages": [{"statistics": {"field": "${field}"}}]}`);
      await settle();
    };
    await write("presure");
    expect(state()).toEqual(["No errors, 1 warning.", "warning", false, 1]);
    expect(document.querySelector("#pipeline-errors li.warning .title")?.textContent).toBe("stages[0].statistics.field: neither the run nor a stage before has a field “presure”; did you mean pressure?");
    document.querySelector<HTMLElement>('#pipeline-errors [data-act="fix"]')!.click();
    expect(FakeEditor.made.replace).toHaveBeenCalledWith(55, 64, '"pressure"');
    // What is told of the run later counts at once.
    made.greet({ fields: [{ name: "presure", association: "vertex", components: 1 }] });
    expect(state()).toEqual(["No errors.", "good", false, 0]);
    made.greet({ fields: [] });
    await write("nothing");
    expect(state()).toEqual(["No errors.", "good", false, 0]);
    made.greet({ channel: "fluid" });
    await write("nothing", '"channel": "solid", ');
    expect(state()).toEqual(["No errors.", "good", false, 0]);
    await write("nothing", '"channel": "fluid", ');
    expect(state()).toEqual(["No errors, 1 warning.", "warning", false, 1]);
    // Where there are errors it may be they that are to blame; and without a checker nobody knows whether there are.
    answer = { errors: [{ line: 1, column: 2, path: "name", message: "found nothing", suggestion: null }], more: 0 };
    await write("nothing");
    expect(state()).toEqual(["1 error.", "bad", true, 1]);
    answer = { failure: "no module" };
    await write("nothing ");
    expect(state()).toEqual(["Not checked here (no module): the run checks it.", "good", false, 0]);
  });

  it("are not warned of as the run has them", async () => {
    known({ name: "later", stages: [{ statistics: { field: "nothing" } }] });
    act("later", "load").click();
    await settle();
    expect([at("pipeline-state").textContent, FakeEditor.made.marks]).toEqual(["No errors.", []]);
  });

  it("are refused in words, with a mark where that is", async () => {
    act("health", "load").click();
    await settle();
    FakeEditor.made.surroundings.written('{"name": "health", "stages": [{"statistics": {"field": "presure"}}]}');
    await settle();
    at("pipeline-apply").click();
    made.store.dispatch({ type: "pipelines refused", id: last().id, text: "pipeline `health`: there is no field 'presure'; did you mean 'pressure'?" });
    expect(at("pipeline-outcome").textContent).toBe("The run refused it: pipeline health: there is no field 'presure'; did you mean 'pressure'?");
    expect(FakeEditor.made.marks).toMatchObject([{ fix: { name: "pressure", insert: '"pressure"' } }]);
    expect([at("pipeline-state").textContent, at("pipeline-state").dataset.tone]).toEqual(["Refused by the run.", "bad"]);
  });

  it("take another name in one change, and are added under a free one", async () => {
    act("cut", "load").click();
    await settle();
    FakeEditor.made.surroundings.written('{"name": "across", "stages": []}');
    await settle();
    at("pipeline-apply").click();
    expect(last()).toMatchObject({ pipelines: { all: [{ name: "across", stages: [] }, health] } });
    outcome("applied");
    known({ name: "across", stages: [] }, health);
    FakeEditor.made.surroundings.leave();
    act("health", "duplicate").click();
    await settle();
    expect(JSON.parse(draft()!.text)).toEqual({ ...health, name: "health 2" });
    at("pipeline-apply").click();
    expect(last()).toMatchObject({ pipelines: { set: [{ name: "health 2" }] } });
  });

  it("are kept as drafts when the editor is left, and taken up again", async () => {
    act("cut", "load").click();
    await settle();
    FakeEditor.made.surroundings.written("{");
    FakeEditor.made.surroundings.leave();
    expect([at("pipelines-list").hidden, row("cut").querySelector(".chip")?.textContent, document.activeElement]).toEqual([false, "draft", act("cut", "load")]);
    act("cut", "load").click();
    expect(draft()).toMatchObject({ text: "{", replaced: "cut" });
    // Over a reload too; rubbish counts as nothing.
    expect(readDrafts(JSON.stringify(made.store.state.pipelines.drafts))[keyOf("cut")]).toMatchObject({ text: "{", replaced: "cut" });
    expect([readDrafts(null), readDrafts("{"), readDrafts('{"a": {"text": 3}}')]).toEqual([{}, {}, {}]);
    at("pipeline-revert").click();
    FakeEditor.made.surroundings.leave();
    expect(row("cut").querySelector(".chip")).toBeNull();
  });

  it("are removed once that is confirmed", () => {
    act("cut", "remove").click();
    expect([row("cut").textContent, document.activeElement]).toEqual(["Remove cut?RemoveKeep", act("cut", "keep")]);
    act("cut", "keep").click();
    expect(made.sent.length).toBe(0);
    act("cut", "remove").click();
    act("cut", "remove").click();
    expect(last()).toMatchObject({ pipelines: { remove: ["cut"] } });
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    expect(at("pipeline-outcome").textContent).toMatch(/^The connection was lost/);
  });

  it("begin with a template, in a menu that the keyboard opens and closes", async () => {
    at("pipeline-add").click();
    expect(document.activeElement).toBe(document.querySelector('[data-template="slice"]'));
    at("pipeline-templates").dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", bubbles: true, cancelable: true }));
    expect([at("pipeline-templates").hidden, document.activeElement]).toEqual([true, at("pipeline-add")]);
    at("pipeline-add").click();
    document.querySelector<HTMLElement>('[data-template="statistics"]')!.click();
    await settle();
    expect(at("pipeline-title").textContent).toBe("New pipeline");
    expect([JSON.parse(draft()!.text).stages, at("pipeline-apply").disabled]).toEqual([[{ statistics: { field: "velocity" } }], false]);
  });
});
