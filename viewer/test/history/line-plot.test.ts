// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage } from "../../src/connection/protocol";
import { LinePlot } from "../../src/history/line-plot";
import { Earlier } from "../../src/picture/earlier";
import { lineBetween } from "../../src/store/pipelines";
import type { Pipeline } from "../../src/store/pipelines";
import { page } from "../page";
import { openDocument } from "../panels/document";

vi.mock("uplot", () => ({ default: class {} }));

/** The plot of a run that has these pipelines, and what it asks of it. */
async function plotted(...has: Pipeline[]) {
  const { store } = page();
  const asked: ClientMessage[] = [];
  const pipelines = new Pipelines(() => Promise.resolve(has), (message) => `${asked.push(message)}`, () => undefined);
  const plot = new LinePlot(store, pipelines, { frame: () => null, look: () => null, title: () => "" }, new Earlier(store, () => [], () => undefined), () => undefined);
  await pipelines.told(1);
  return { store, asked, plot };
}

describe("the line of the plot", () => {
  beforeEach(() => {
    openDocument();
    vi.stubGlobal("ResizeObserver", class { observe(): void { /* Nothing changes its size here. */ } });
    return () => vi.unstubAllGlobals();
  });

  it("is a pipeline of its own where there is none", async () => {
    const { asked, plot } = await plotted();
    plot.take([0, 0, 0], [1, 0, 0]);
    expect(asked).toEqual([{ pipelines: { set: [lineBetween([0, 0, 0], [1, 0, 0])] } }]);
  });

  it("is moved in a pipeline of the configuration, which keeps its other stages", async () => {
    const own: Pipeline = { name: "line", stages: [{ probe: { line: { from: [0, 0, 0], to: [1, 0, 0], count: 1001 } } }, { csv: { file: "line.csv" } }] };
    const { asked, plot } = await plotted(own);
    plot.take([0, 0, 0], [2, 0, 0]);
    expect(asked).toEqual([{ pipelines: { set: [{ ...own, stages: [{ probe: { line: { from: [0, 0, 0], to: [2, 0, 0], count: 1001 } } }, own.stages[1]] }] } }]);
  });

  it("keeps the coordinates that nobody has typed, to the last bit", async () => {
    const { asked, plot } = await plotted(lineBetween([1234.56789, 1 / 3, 0.1], [2000.00001, -1e-7, 5]));
    const inputs = [...plot.body.querySelectorAll("input")];
    expect(inputs.map(({ value }) => value)).toEqual(["1234.5679", "0.3333333", "0.1", "2000", "-1e-7", "5"]);
    expect(inputs.map(({ title }) => title)).toEqual(["1234.56789", String(1 / 3), "", "2000.00001", "", ""]);
    inputs[2]!.value = "0.2";
    inputs[2]!.dispatchEvent(new Event("change"));
    expect(asked).toEqual([{ pipelines: { set: [lineBetween([1234.56789, 1 / 3, 0.2], [2000.00001, -1e-7, 5])] } }]);
  });

  it("does not take the place of a pipeline of its name that is something else", async () => {
    const { store, asked, plot } = await plotted({ name: "line", stages: [{ slice: { origin: [0, 0, 0], normal: [1, 0, 0] } }, { stream: {} }] });
    plot.take([0, 0, 0], [2, 0, 0]);
    expect(asked).toEqual([]);
    expect(store.state.refusal).toContain("“line”");
  });

  it("is not asked of a recording, which says so", async () => {
    const { store, asked, plot } = await plotted();
    const moment = { seconds: 0, cycle: 0, time: 0 };
    store.dispatch({ type: "hello", hello: { ...store.state.hello!, recording: { first: moment, last: moment } } });
    plot.take([0, 0, 0], [1, 0, 0]);
    expect(asked).toEqual([]);
    expect(store.state.refusal).toBe("A plot over a line takes a change of the pipelines. This is a recording: it can be watched, and not be steered.");
    expect([...plot.body.querySelectorAll("input")].map(({ value }) => value)).toEqual(["", "", "", "", "", ""]);
    expect(plot.body.textContent).toContain(store.state.refusal);
  });
});
