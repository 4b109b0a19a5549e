import { describe, expect, it } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage, Json } from "../../src/connection/protocol";

const pipeline = (x: number) => ({ name: "cut", stages: [{ slice: { origin: [x, 0, 0], normal: [1, 0, 0] } }] });

/** Pipelines of a run that has the one of `x`, and what was asked of it. */
function made() {
  const run = { has: pipeline(0), asked: [] as ClientMessage[], failed: [] as string[] };
  const pipelines = new Pipelines(() => Promise.resolve([run.has] as unknown as Json), (message) => `id ${run.asked.push(message)}`, (reason) => run.failed.push(reason));
  return { run, pipelines };
}

describe("changes of pipelines", () => {
  it("go one at a time, the newest wish next", () => {
    const { run, pipelines } = made();
    for (const x of [1, 2, 3]) pipelines.set(pipeline(x));
    expect(run.asked).toHaveLength(1);
    expect(pipelines.answered("id 1")).toBe(true);
    expect(run.asked).toHaveLength(2);
    expect(JSON.stringify(run.asked[1])).toContain("[3,0,0]");
    expect(pipelines.answered("another's")).toBe(false);
  });

  it("count for more than what the run has until it has answered the last of them", async () => {
    const { run, pipelines } = made();
    await pipelines.told(1);
    pipelines.set(pipeline(1));
    pipelines.set(pipeline(2));
    run.has = pipeline(1);
    pipelines.answered("id 1");
    await pipelines.told(2);
    expect(pipelines.get("cut")).toEqual(pipeline(2));
    run.has = pipeline(2);
    pipelines.answered("id 2");
    run.has = pipeline(9);
    await pipelines.told(3);
    expect(pipelines.get("cut")).toEqual(pipeline(9));
  });
});
