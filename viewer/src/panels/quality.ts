/** "min quality" as a button: has the worst cells streamed, flies to the worst and rings ten of them. Again: takes them away. */
import type { Pipelines } from "../connection/pipelines";
import { digits } from "../number";
import type { Stand } from "../picture/camera";
import type { Marks } from "../picture/marks";
import type { Scene } from "../picture/scene";
import { worstOf } from "../picture/worst";
import type { Action } from "../store/actions";
import { appliedOrders, isShapeUnderWay } from "../store/orders";
import { QUALITY, WORST, countCells, countedIn, poorRange, worstCells, worstUpTo } from "../store/pipelines";
import { isSteering, whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";

/** The layers and the camera of the picture. */
type Picture = Pick<Scene, "layers"> & { camera: Pick<Scene["camera"], "stand" | "flyTo"> };

export class WorstCells {
  private shown = false;
  private isToFly = false;
  /** Where the camera stood before it flew to the worst cell. */
  private before: Stand | null = null;
  /** The range of quality in which the run is counting cells for this page; null where it is not. */
  private counted: readonly [number, number] | null = null;

  constructor(private readonly button: HTMLElement, private readonly store: Store<State, Action>, private readonly pipelines: Pick<Pipelines, "set" | "remove">, private readonly scene: Picture, private readonly marks: Pick<Marks, "set">) {
    button.addEventListener("click", () => (this.shown ? this.hide() : this.show()));
    store.watch((state) => state.hello?.views.some((view) => view.name === WORST) === true, (there) => {
      if (there) store.dispatch({ type: "look", view: WORST, look: { field: QUALITY, edges: "mesh" } });
    });
    // In another shape other cells are the worst, and another number of them is as bad.
    let orders = appliedOrders(store.state).length;
    store.watch((state) => (isShapeUnderWay(state.orders) ? null : appliedOrders(state).length), (applied) => {
      if (applied === null || applied === orders) return;
      orders = applied;
      if (this.shown && isSteering(store.state)) this.search();
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
    this.before = this.scene.camera.stand;
    this.scene.camera.flyTo(worst.centroid);
  }

  /** The run has counted its cells: those that are the worst are shown, or looked for more closely. */
  take(values: Readonly<Record<string, number | null>>): void {
    const cells = countedIn(values);
    // It may be what was asked for before, or by another page.
    if (!this.counted || cells?.low !== this.counted[0] || cells.high !== this.counted[1]) return;
    const found = worstUpTo(cells);
    this.counted = found && "range" in found ? found.range : null;
    if (this.counted) return this.pipelines.set(countCells(this.counted));
    if (found && "max" in found) return this.pipelines.set(worstCells(found.max));
    this.hide();
    this.store.dispatch({ type: "refused", id: null, text: "Too many cells are alike in quality: no ten of them are the worst." });
  }

  private search(): void {
    const { quality } = this.store.state.status ?? {};
    if (!quality) return;
    this.counted = poorRange(quality);
    this.pipelines.set(countCells(this.counted));
  }

  private show(): void {
    const { state } = this.store;
    const isThere = state.hello?.views.some((view) => view.name === WORST) === true;
    const why = whyNotSteering(state);
    const isMeasured = Boolean(state.status?.quality);
    if (!isThere && (why !== "" || !isMeasured)) {
      return this.store.dispatch({ type: "refused", id: null, text: why === "" ? "The run has not measured its mesh yet." : `Nobody has the worst cells streamed, which takes a change of the pipelines. ${why}` });
    }
    if (why === "") this.search();
    this.shown = this.isToFly = true;
    this.before = null;
    this.button.setAttribute("aria-pressed", "true");
    this.update();
  }

  private hide(): void {
    this.shown = false;
    this.counted = null;
    this.button.setAttribute("aria-pressed", "false");
    this.marks.set("worst", []);
    if (isSteering(this.store.state)) this.pipelines.remove(WORST);
    if (this.before) this.scene.camera.stand = this.before;
    this.before = null;
  }
}
