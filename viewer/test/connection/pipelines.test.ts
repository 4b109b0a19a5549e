import { afterEach, describe, expect, it, vi } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage, Json } from "../../src/connection/protocol";

const pipeline = (x: number, name = "cut") => ({ name, stages: [{ slice: { origin: [x, 0, 0], normal: [1, 0, 0] } }] });

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

  it("of several pipelines wait beside each other, each in its turn", () => {
    const { run, pipelines } = made();
    for (const x of [1, 2, 3]) pipelines.set(pipeline(x));
    pipelines.set(pipeline(5, "other"));
    pipelines.set(pipeline(4));
    for (const id of ["id 1", "id 2", "id 3"]) pipelines.answered(id);
    expect(run.asked).toEqual([pipeline(1), pipeline(4), pipeline(5, "other")].map((one) => ({ pipelines: { set: [one] } })));
  });

  it("say of which pipeline they are, and remove nothing twice", () => {
    const { run, pipelines } = made();
    pipelines.set(pipeline(1));
    expect([pipelines.changedBy("id 1"), pipelines.changedBy("id 2"), pipelines.changedBy(null), pipelines.isOnItsWay("cut"), pipelines.isOnItsWay("other")])
      .toEqual(["cut", null, null, true, false]);
    pipelines.remove("cut");
    pipelines.answered("id 1");
    pipelines.remove("cut");
    pipelines.answered("id 2");
    expect([run.asked.slice(1), pipelines.isOnItsWay("cut")]).toEqual([[{ pipelines: { remove: ["cut"] } }], false]);
    // What is set in between is to be removed as well.
    pipelines.remove("cut");
    pipelines.set(pipeline(2));
    pipelines.remove("cut");
    pipelines.answered("id 3");
    expect(run.asked.slice(2)).toEqual([1, 2].map(() => ({ pipelines: { remove: ["cut"] } })));
  });

  it("do not outlive the connection: what the run has is asked for anew", async () => {
    const { run, pipelines } = made();
    let shown = 0;
    pipelines.onChange(() => { shown++; });
    await pipelines.told(1);
    pipelines.set(pipeline(9));
    pipelines.forget();
    expect([pipelines.get("cut"), shown]).toEqual([pipeline(0), 2]);
    run.has = pipeline(3);
    await pipelines.told(1);
    expect(pipelines.get("cut")).toEqual(pipeline(3));
  });

  it("are not shown where there is no connection to send them over", async () => {
    const pipelines = new Pipelines(() => Promise.resolve([pipeline(0)]), () => null, () => undefined);
    await pipelines.told(1);
    pipelines.set(pipeline(9));
    expect(pipelines.get("cut")).toEqual(pipeline(0));
  });

  it("are put right by what the run has, however many it refuses", async () => {
    const { pipelines } = made();
    await pipelines.told(1);
    for (const id of ["id 1", "id 2"]) {
      pipelines.set(pipeline(9));
      pipelines.answered(id);
      await pipelines.reload();
      expect(pipelines.get("cut")).toEqual(pipeline(0));
    }
  });
});

describe("the pipelines of the run", () => {
  afterEach(() => { vi.useRealTimers(); });

  it("are those of the newest answer that was asked for", async () => {
    const answers: ((has: Json) => void)[] = [];
    const pipelines = new Pipelines(() => new Promise((resolve) => { answers.push(resolve); }), () => "id", () => undefined);
    const told = [pipelines.told(1), pipelines.told(2)];
    answers[1]!([pipeline(2)]);
    answers[0]!([pipeline(1)]);
    await Promise.all(told);
    expect(pipelines.get("cut")).toEqual(pipeline(2));
  });

  it("are asked for again where that has failed, less and less often, and reported once", async () => {
    vi.useFakeTimers();
    let asked = 0;
    const failed: string[] = [];
    const pipelines = new Pipelines(() => (++asked < 4 ? Promise.reject(new Error("Bad Gateway")) : Promise.resolve([pipeline(1)])), () => "id", (reason) => failed.push(reason));
    await pipelines.told(1);
    await vi.advanceTimersByTimeAsync(999);
    expect(asked).toBe(1);
    await vi.advanceTimersByTimeAsync(1 + 2000 + 4000);
    expect([asked, pipelines.get("cut"), failed]).toEqual([4, pipeline(1), ["Error: Bad Gateway"]]);
    await vi.advanceTimersByTimeAsync(100_000);
    expect(asked).toBe(4);
  });

  it("are asked for no more once the connection is lost", async () => {
    vi.useFakeTimers();
    let asked = 0;
    const pipelines = new Pipelines(() => { asked++; return Promise.reject(new Error("Bad Gateway")); }, () => "id", () => undefined);
    await pipelines.told(1);
    pipelines.forget();
    await vi.advanceTimersByTimeAsync(100_000);
    expect(asked).toBe(1);
  });
});
