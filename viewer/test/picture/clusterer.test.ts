import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { TopologyFrame } from "../../src/connection/protocol";
import { Clusterer, PATIENCE } from "../../src/picture/clusterer";
import type { ClusterAnswer, ClusterQuestion, ClusterWorker } from "../../src/picture/clusterer";
import { MOST_TRIANGLES } from "../../src/picture/clustering";

let asked: ClusterQuestion[], worker: ClusterWorker, started: number, clusterer: Clusterer;
beforeEach(() => {
  vi.useFakeTimers();
  [asked, started] = [[], 0];
  worker = { postMessage: (question) => asked.push(question), onmessage: null, onerror: null };
  clusterer = new Clusterer(() => {
    started++;
    return worker;
  });
});
afterEach(() => { vi.useRealTimers(); });

const topology = (triangles = MOST_TRIANGLES + 1): TopologyFrame => ({
  kind: "topology", view: "shell", topology: "1", points: 3, triangles: new Uint32Array(3 * triangles), triangleFeatures: null, lines: new Uint32Array(0),
});
const points = new Float32Array(9);
const clusters = { representatives: new Uint32Array(3), triangles: new Uint32Array(3) };
const answer = (data: ClusterAnswer): void => worker.onmessage?.({ data } as MessageEvent<ClusterAnswer>);

test("a small view is never clustered, and a large one once it has been there for a moment", () => {
  const answered = vi.fn();
  clusterer.want(topology(MOST_TRIANGLES), points, answered);
  vi.advanceTimersByTime(2 * PATIENCE);
  expect(started).toBe(0);
  clusterer.want(topology(), points, answered);
  vi.advanceTimersByTime(PATIENCE - 1);
  expect(started).toBe(0);
  vi.advanceTimersByTime(1);
  expect(asked.length).toBe(1);
  answer(clusters);
  expect(answered).toHaveBeenCalledExactlyOnceWith(clusters);
});

test("views are drawn whole where no worker can be started, and the next is asked for all the same", () => {
  vi.spyOn(console, "error").mockImplementation(() => undefined);
  const answered: ClusterAnswer[] = [];
  clusterer = new Clusterer(() => { throw new Error("no more workers"); });
  for (const wanted of [topology(), topology()]) clusterer.want(wanted, points, (found) => answered.push(found));
  vi.advanceTimersByTime(PATIENCE);
  expect(answered).toEqual([null, null]);
});

test("a topology that has gone is not clustered, and its clusters go to nobody", () => {
  const answered = vi.fn();
  const gone = clusterer.want(topology(), points, answered);
  gone();
  vi.advanceTimersByTime(PATIENCE);
  expect(asked.length).toBe(0);
  const [first, second] = [clusterer.want(topology(), points, answered), clusterer.want(topology(), points, answered)];
  vi.advanceTimersByTime(PATIENCE);
  first();
  second();
  answer(clusters);
  expect(asked.length).toBe(1);
  expect(answered).not.toHaveBeenCalled();
});

test("several are clustered one after the other, and the same one once", () => {
  const answered: ClusterAnswer[] = [];
  const [one, other] = [topology(), topology()];
  for (const wanted of [one, other, one]) clusterer.want(wanted, points, (found) => answered.push(found));
  vi.advanceTimersByTime(PATIENCE);
  expect(asked.length).toBe(1);
  answer(clusters);
  expect(asked.length).toBe(2);
  answer(null);
  expect(asked.length).toBe(2);
  expect(answered).toEqual([clusters, null, clusters]);
});

test("where the worker fails views are drawn whole", () => {
  const answered = vi.fn();
  clusterer.want(topology(), points, answered);
  vi.advanceTimersByTime(PATIENCE);
  worker.onerror?.({} as ErrorEvent);
  expect(answered).toHaveBeenCalledExactlyOnceWith(null);
});
