/** "min quality" as a button: has the worst cells streamed, flies to the worst, outlines and rings ten of them. Again: takes them away. */
import type { Pipelines } from "../connection/pipelines";
import { digits } from "../number";
import type { Stand } from "../picture/camera";
import type { Marks } from "../picture/marks";
import type { Scene } from "../picture/scene";
import { worstOf } from "../picture/worst";
import type { Action } from "../store/actions";
import { appliedOrders, isShapeUnderWay } from "../store/orders";
import { QUALITY, WORST, countCells, countedIn, isCounted, poorRange, worstCells, worstUpTo } from "../store/pipelines";
import { isSteering, whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import { sameParts } from "../store/store";
import type { Store } from "../store/store";

const isStreamed = ({ hello }: State): boolean => hello?.views.some((view) => view.name === WORST) === true;
/** Whether the run has the pipeline of the worst cells, for the count or as a view. */
const isThere = (state: State): boolean => isStreamed(state) || isCounted(state.hello);

/** Whether what the run has can be removed. Until a new connection has said what that is, it is known of the one before alone. */
const canTidy = (state: State): boolean => isSteering(state) && !state.connection.fresh;

/** The layers and the camera of the picture. */
type Picture = Pick<Scene, "layers"> & { camera: Pick<Scene["camera"], "stand" | "flyTo"> };

export class WorstCells {
  private shown = false;
  private isToFly = false;
  /** Where the camera stood before it flew to the worst cell. */
  private before: Stand | null = null;
  /** The range of quality in which the run is counting cells for this page; null where it is not. */
  private counted: readonly [number, number] | null = null;
  /** Whether this page has had the pipeline made, and has not had it removed. */
  private isOwn = false;

  constructor(private readonly button: HTMLElement, private readonly store: Store<State, Action>, private readonly pipelines: Pick<Pipelines, "set" | "remove" | "isOnItsWay">, private readonly scene: Picture, private readonly marks: Pick<Marks, "set">) {
    button.addEventListener("click", () => (this.shown ? this.hide() : this.show()));
    store.watch(isStreamed, (there) => {
      if (there) store.dispatch({ type: "look", view: WORST, look: { field: QUALITY, edges: "mesh" } });
    });
    // In another shape other cells are the worst, and another number of them is as bad.
    let orders = appliedOrders(store.state).length;
    store.watch((state) => (isShapeUnderWay(state.orders) ? null : appliedOrders(state).length), (applied) => {
      if (applied === null || applied === orders) return;
      orders = applied;
      if (this.shown && isSteering(store.state)) this.search();
    });
    store.watch(isSteering, (steers) => {
      // Only whoever steers can end a search, or remove what it has left in the run.
      if (!steers && this.isSearching) this.release();
    });
    store.watch(isThere, (there) => {
      // Somebody has removed it.
      if (!there && this.shown && !pipelines.isOnItsWay(WORST)) this.release();
    });
    store.watch((state) => isCounted(state.hello), (counted) => {
      // Another page searches: what comes of that is its own.
      if (counted && !isSteering(store.state)) this.isOwn = false;
    });
    store.watch((state) => [canTidy(state), isStreamed(state), isCounted(state.hello)], () => this.tidy(), sameParts);
  }

  /** Whether the pipeline is of this page: kept over a reload, so that the page knows it again. */
  get kept(): boolean {
    return this.isOwn;
  }

  /** The page was loaded again, and the pipeline was its own before: what is streamed is shown as it was, and a count that nobody ends is removed. */
  restore(isOwn: boolean): void {
    const { state } = this.store;
    this.isOwn = isOwn && isThere(state);
    if (!this.isOwn) return;
    if (isStreamed(state)) this.press();
    else this.tidy();
  }

  /** The page is left: without it nobody would end a count. */
  leave(): void {
    if (this.isSearching) this.hide();
  }

  /** The run has refused a change of the pipeline: there will be nothing to show. */
  refused(): void {
    // A newer change may be on its way.
    if (!this.shown || this.pipelines.isOnItsWay(WORST)) return;
    this.release();
    this.tidy();
  }

  /** Something else is drawn. */
  update(): void {
    const layer = this.shown ? this.scene.layers.get(WORST) : undefined;
    const cells = layer?.topology && layer.frame ? worstOf(layer.topology, layer.frame) : [];
    this.marks.set("worst", cells.map(({ quality, centroid, edges }, i) => ({ points: [centroid], edges, label: i === 0 ? `quality ${digits(quality, 3)}` : "", kind: "cell" as const })));
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
    if (!isSteering(this.store.state) || !this.counted || cells?.low !== this.counted[0] || cells.high !== this.counted[1]) return;
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
    this.isOwn = true;
    this.pipelines.set(countCells(this.counted));
  }

  private show(): void {
    const { state } = this.store;
    const why = whyNotSteering(state);
    const isMeasured = Boolean(state.status?.quality);
    if (!isStreamed(state) && (why !== "" || !isMeasured)) {
      return this.store.dispatch({ type: "refused", id: null, text: why === "" ? "The run has not measured its mesh yet." : `Nobody has the worst cells streamed, which takes a change of the pipelines. ${why}` });
    }
    if (why === "") this.search();
    this.isToFly = true;
    this.before = null;
    this.press();
  }

  /** Whether they are looked for, and the run does not stream them yet. */
  private get isSearching(): boolean {
    return this.shown && (this.counted !== null || !isStreamed(this.store.state));
  }

  private press(): void {
    this.shown = true;
    this.button.setAttribute("aria-pressed", "true");
    this.update();
  }

  private hide(): void {
    const { before } = this;
    this.release();
    if (isSteering(this.store.state)) this.remove();
    if (before) this.scene.camera.stand = before;
  }

  /** Shows them no more. The camera stays: nobody has asked for it. */
  private release(): void {
    this.shown = this.isToFly = false;
    this.counted = null;
    this.before = null;
    this.button.setAttribute("aria-pressed", "false");
    this.marks.set("worst", []);
  }

  private remove(): void {
    this.isOwn = false;
    this.pipelines.remove(WORST);
  }

  /**
   * Removes what a search has left in the run, once this page steers: a view of its own that it does not show, and any count, for
   * only whoever steers could make something of it.
   */
  private tidy(): void {
    const { state } = this.store;
    if (canTidy(state) && !this.shown && (isCounted(state.hello) || (this.isOwn && isStreamed(state)))) this.remove();
  }
}
