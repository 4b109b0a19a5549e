/** What the views held before the last order changed the shape, or when somebody asked for it to be kept: one moment, of each view one frame. */
import type { DataFrame, TopologyFrame } from "../connection/protocol";
import type { Action } from "../store/actions";
import { appliedOrders, isShapeUnderWay } from "../store/orders";
import type { State } from "../store/state";
import type { Store } from "../store/store";

export interface Content { topology: TopologyFrame; frame: DataFrame }
export type Moment = ReadonlyMap<string, Content>;

/** A view as it is now. */
interface Shown { readonly name: string; readonly topology: TopologyFrame | null; readonly frame: DataFrame | null }

export class Earlier {
  private kept: Moment = new Map();
  private text = "";
  /** The moment at which an order began, which may yet be refused. */
  private begun: Moment | null = null;

  /** `views` are those that are there; `changed` is called when another moment is kept. */
  constructor(store: Store<State, Action>, private readonly views: () => Iterable<Shown>, private readonly changed: () => void) {
    store.watch((state) => isShapeUnderWay(state.orders), (isUnderWay) => { if (isUnderWay) this.begun = this.now(); });
    let known = appliedOrders(store.state).length;
    store.watch(appliedOrders, (orders) => {
      const newest = orders.at(-1);
      if (orders.length > known && newest && this.begun && this.begun.size > 0) this.keep(this.begun, `before “${newest.label}”`);
      // In a recording one may go back: an order that is of the future now began at another moment.
      else if (orders.length < known && !isShapeUnderWay(store.state.orders)) this.begun = null;
      known = orders.length;
    });
  }

  get moment(): Moment {
    return this.kept;
  }

  /** Which moment it is, in words; empty where nothing is kept. */
  get label(): string {
    return this.text;
  }

  /** Keeps what is there now. */
  keepNow(): void {
    const now = this.now();
    const [first] = now.values();
    if (first) this.keep(now, `at cycle ${first.frame.cycle}`);
  }

  private keep(moment: Moment, label: string): void {
    this.kept = moment;
    this.text = label;
    this.changed();
  }

  private now(): Moment {
    return new Map([...this.views()].flatMap(({ name, topology, frame }) => (topology && frame ? [[name, { topology, frame }] as const] : [])));
  }
}
