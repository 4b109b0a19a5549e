/** Asks for what an order may hold, which no hello says: it is long and stays the same. */
import type { Hello, Json } from "../connection/protocol";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { initialSettings } from "./form";
import { orderForm } from "./schema";

export class SchemaLoader {
  private isLoading = false;

  constructor(private readonly store: Store<State, Action>, private readonly load: () => Promise<Json>) {}

  /** Loads it where it is not there, nor on its way. */
  async want({ defaults }: Pick<Hello, "defaults">): Promise<void> {
    if (this.isLoading || this.store.state.form) return;
    this.isLoading = true;
    try {
      this.store.dispatch({ type: "schema", form: orderForm(await this.load()), settings: initialSettings(defaults) });
    } catch (error) {
      this.store.dispatch({ type: "unreadable", text: `what an order may hold: ${String(error)}` });
    } finally {
      this.isLoading = false;
    }
  }
}
