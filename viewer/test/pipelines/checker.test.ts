import { describe, expect, it } from "vitest";
import type { PipelineQuestion } from "../../src/kernel/language";
import { Checker } from "../../src/pipelines/checker";
import type { CheckAnswer, CheckWorker } from "../../src/pipelines/checker";

const question = (text: string): PipelineQuestion => ({ text, replaced: null, pipelines: [], parameters: [] });

describe("the checker", () => {
  it("says so where its worker does not start, and tries another with the next question", () => {
    const workers: CheckWorker[] = [];
    const asked: string[] = [];
    const ended: CheckWorker[] = [];
    const heard: CheckAnswer[] = [];
    const checker = new Checker(() => {
      const worker: CheckWorker = { onmessage: null, onerror: null, postMessage: (message) => asked.push((message as PipelineQuestion).text), terminate: () => ended.push(worker) };
      workers.push(worker);
      return worker;
    });
    const check = (text: string): void => checker.check(question(text), (answer) => heard.push(answer));
    const fail = (message: string): void => workers.at(-1)!.onerror!({ message } as ErrorEvent);
    check("a");
    fail("");
    expect(heard).toEqual([{ failure: "what checks it could not be started" }]);
    // Of those that wait meanwhile the newest is asked of the next one.
    for (const text of ["b", "c", "d"]) check(text);
    fail("out of memory");
    expect([heard[1], asked, workers.length]).toEqual([{ failure: "out of memory" }, ["a", "b", "d"], 3]);
    workers[2]!.onmessage!(new MessageEvent<CheckAnswer>("message", { data: { errors: [], more: 0 } }));
    expect([heard.at(-1), heard.length, ended]).toEqual([{ errors: [], more: 0 }, 3, workers.slice(0, 2)]);
    check("e");
    expect([asked.at(-1), workers.length]).toEqual(["e", 3]);
  });
});
