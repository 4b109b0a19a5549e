import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { SchemaLoader } from "../../src/form/loader";
import { reduce } from "../../src/store/reduce";
import { INITIAL } from "../../src/store/state";
import { Store } from "../../src/store/store";
import { defaults, schema } from "../page";

describe("what an order may hold", () => {
  it("is asked for once, and again where it did not come", async () => {
    const store = new Store(INITIAL, reduce);
    const asked: { resolve: (schema: Json) => void; reject: (reason: Error) => void }[] = [];
    const loader = new SchemaLoader(store, () => new Promise((resolve, reject) => { asked.push({ resolve, reject }); }));
    const first = loader.want({ defaults });
    await loader.want({ defaults });
    expect(asked).toHaveLength(1);
    asked[0]!.reject(new Error("gone"));
    await first;
    expect([store.state.form, store.state.errors]).toEqual([null, ["what an order may hold: Error: gone"]]);
    const second = loader.want({ defaults });
    asked[1]!.resolve(schema);
    await second;
    expect(store.state.form?.edits.length).toBeGreaterThan(3);
    expect(store.state.draft.settings).toEqual({ schedule: defaults.schedule });
    await loader.want({ defaults });
    expect(asked).toHaveLength(2);
  });
});
