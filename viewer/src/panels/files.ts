/** What goes into files and comes out of them: the edits, the surface as it is now, its displacement, the chosen view. */
import { download, element, part } from "../dom";
import { LARGEST, readEdits, writeEdits } from "../files/edits";
import { displacements, stl, vtp } from "../files/surface";
import type { Content } from "../picture/earlier";
import type { ShownPoints } from "../preview/previewer";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { whyNotEditable } from "../store/edits";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

export interface FileSource {
  /** The points of the surface in the shape that is now. */
  surface(): Promise<ShownPoints>;
  /** What a view holds now. */
  content(view: string): Content | null;
}

export class FilesPanel {
  private readonly input = element("input", { type: "file", accept: ".json,application/json", hidden: true, onchange: () => void this.load() });

  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands, private readonly source: FileSource) {
    const button = (text: string, title: string, act: () => void): HTMLButtonElement => element("button", { type: "button", class: "small", title, onclick: act }, text);
    const save = button("Save edits", "The edits as JSON: this page loads them again, and a file of orders takes them", () => this.saveEdits());
    const load = button("Load edits", "Orders the edits of a file in place of those that there are", () => this.input.click());
    const surface = button("Surface (STL)", "The surface in the shape that it has now", () => void this.saveSurface((shown) => [new Blob([stl(shown.points, shown.triangles)]), "stl"]));
    const moved = button("Displacement (CSV)", "Each vertex of the surface, and how far it has gone from the reference", () => void this.saveSurface(({ reference, points }) => [new Blob([displacements(reference, points)], { type: "text/csv" }), "csv"]));
    const view = button("View (VTP)", "The chosen view with all its fields, for ParaView", () => this.saveView());
    part("files-body").append(save, load, surface, moved, view, this.input);
    store.watch((state) => [whyNotEditable(state), (state.hello?.stack ?? []).length, state.hello?.surface != null, state.chosenView] as const, ([why, edits, hasSurface, chosen]) => {
      load.disabled = why !== "";
      load.title = why || "Orders the edits of a file in place of those that there are";
      save.disabled = edits === 0;
      surface.disabled = moved.disabled = !hasSurface;
      view.disabled = chosen === null;
    }, sameJson);
  }

  private name(what: string): string {
    return `tombolo-${what}-${this.store.state.frames.cycle ?? this.store.state.status?.cycle ?? 0}`;
  }

  private refuse(text: string): void {
    this.store.dispatch({ type: "refused", id: null, text });
  }

  private saveEdits(): void {
    download(new Blob([writeEdits(this.store.state.hello?.stack ?? [])], { type: "application/json" }), `${this.name("edits")}.json`);
  }

  private async load(): Promise<void> {
    const [file] = this.input.files ?? [];
    this.input.value = "";
    if (!file) return;
    if (file.size > LARGEST) return this.refuse(`${file.name} has ${file.size} bytes, more than the ${LARGEST} of an order.`);
    const found = readEdits(await file.text());
    if ("wrong" in found) return this.refuse(`${file.name} cannot be loaded: ${found.wrong}.`);
    this.commands.setStack(found.stack);
  }

  private async saveSurface(made: (surface: ShownPoints) => [Blob, string]): Promise<void> {
    let shown: ShownPoints;
    try {
      shown = await this.source.surface();
    } catch (error) {
      return this.refuse(`The surface cannot be saved: ${error instanceof Error ? error.message : String(error)}.`);
    }
    const [content, kind] = made(shown);
    download(content, `${this.name(kind === "stl" ? "surface" : "displacement")}.${kind}`);
  }

  private saveView(): void {
    const { chosenView } = this.store.state;
    const content = chosenView === null ? null : this.source.content(chosenView);
    if (!content) return this.refuse("The chosen view holds nothing yet.");
    download(new Blob([vtp(content.topology, content.frame)], { type: "application/xml" }), `${this.name(chosenView!.replaceAll(/[^A-Za-z0-9_-]+/g, "-"))}.vtp`);
  }
}
