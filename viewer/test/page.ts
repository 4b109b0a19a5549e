/** A page's store as it is once a simulation has said who it is, for tests. */
import type { Condition, Hello, Json } from "../src/connection/protocol";
import { orderForm } from "../src/form/schema";
import type { Action } from "../src/store/actions";
import { Commands } from "../src/store/commands";
import { reduce } from "../src/store/reduce";
import { INITIAL } from "../src/store/state";
import type { State } from "../src/store/state";
import { Store } from "../src/store/store";
// As the server sends it; `tombolo schema` and the crate tombolo-pipelines make it.
import orderSchema from "./order-schema.json";

export const schema = orderSchema as unknown as Json;
export const defaults = { schedule: { steps: 10, every: { steps: 5 } }, guard: { min_scaled_jacobian: 0.03, otherwise: "reject" } };

export const feature = (name: string, condition: Condition | null = null) =>
  ({ name, faces: 4, vertices: 4, bounds: [[0, 0, 0], [1, 1, 1]] as [[number, number, number], [number, number, number]], condition });

export const HELLO: Hello = {
  protocol: 2, client: "c1", back: "b", role: "driver", may_drive: true, views: [], features: ["inlet", "outlet", "wall", "throat"].map((name) => feature(name)),
  surface: { id: "s", vertices: 8, faces: 12 }, fields: [], parameters: [], stack: [], orders: [], defaults,
};

export const STATUS = { cycle: 7, time: 0.7, paused: false, stopped: false, viewers: 1, driver: "c1" };

/** A store that has heard a hello, and what its commands have sent. */
export function page(hello: Partial<Hello> = {}) {
  const store = new Store<State, Action>(INITIAL, reduce);
  const sent: { [key: string]: Json }[] = [];
  const commands = new Commands(store, (message) => sent.push(structuredClone(message) as { [key: string]: Json }) > 0);
  const greet = (more: Partial<Hello>): void => store.dispatch({ type: "hello", hello: { ...HELLO, ...hello, ...more } });
  store.dispatch({ type: "connection", state: "connected", explanation: "" });
  greet({});
  store.dispatch({ type: "status", status: STATUS, at: 0 });
  store.dispatch({ type: "schema", form: orderForm(schema), settings: { schedule: defaults.schedule } });
  /** The orders that were sent, without their schedule. */
  const orders = (): Json[] => sent.flatMap(({ order }) => {
    if (typeof order !== "object" || order === null || Array.isArray(order)) return [];
    const { schedule: _, ...rest } = order;
    return [rest];
  });
  return { store, commands, sent, greet, orders };
}
