/** "min quality" as a button: has the worst cells streamed, flies to the worst and rings ten of them. Again: takes them away. */
import type { Pipelines } from "../connection/pipelines";
import { digits } from "../number";
import type { Marks } from "../picture/marks";
import type { Scene } from "../picture/scene";
import { worstOf } from "../picture/worst";
import type { Action } from "../store/actions";
import { QUALITY, WORST, worstCells } from "../store/pipelines";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";

export class WorstCells {
  private shown = false;
  private isToFly = false;

  constructor(private readonly button: HTMLElement, private readonly store: Store<State, Action>, private readonly pipelines: Pipelines, private readonly scene: Scene, private readonly marks: Marks) {
    button.addEventListener("click", () => (this.shown ? this.hide() : this.show()));
    store.watch((state) => state.hello?.views.some((view) => view.name === WORST) === true, (there) => {
      if (there) store.dispatch({ type: "look", view: WORST, look: { field: QUALITY, edges: "mesh" } });
    });
  }

  /** Something else is drawn. */
  update(): void {
    const layer = this.shown ? this.scene.layers.get(WORST) : undefined;
    const cells = layer?.topology && layer.frame ? worstOf(layer.topology, layer.frame) : [];
    this.marks.set("worst", cells.map(({ quality, centroid }, i) => ({ points: [centroid], label: i === 0 ? `quality ${digits(quality, 3)}` : "", kind: "cell" as const })));
    const [worst] = cells;
    if (!worst || !this.isToFly) return;
    this.isToFly = false;
    this.scene.camera.flyTo(worst.centroid);
  }

  private show(): void {
    const { state } = this.store;
    const isThere = state.hello?.views.some((view) => view.name === WORST) === true;
    const why = whyNotSteering(state);
    const quality = state.status?.quality;
    if (!isThere && (why !== "" || !quality)) {
      return this.store.dispatch({ type: "refused", id: null, text: why === "" ? "The run has not measured its mesh yet." : `Nobody has the worst cells streamed, which takes a change of the pipelines. ${why}` });
    }
    if (!isThere && quality) this.pipelines.set(worstCells(quality));
    this.shown = this.isToFly = true;
    this.button.setAttribute("aria-pressed", "true");
    this.update();
  }

  private hide(): void {
    this.shown = false;
    this.button.setAttribute("aria-pressed", "false");
    this.marks.set("worst", []);
    if (whyNotSteering(this.store.state) === "") this.pipelines.remove(WORST);
    this.scene.camera.reset();
  }
}
