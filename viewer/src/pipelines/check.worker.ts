/** Checks pipelines that are being written, by the code with which the run reads them. */
import { Language, compileLanguage } from "../kernel/language";
import type { PipelineQuestion } from "../kernel/language";
import type { CheckAnswer } from "./checker";

const worker = self as unknown as { onmessage: ((event: MessageEvent<PipelineQuestion>) => void) | null; postMessage(answer: CheckAnswer): void };

let language: Promise<Language> | null = null;

/** The module is fetched with the first question; one that did not arrive, with the next. */
async function loaded(): Promise<Language> {
  language ??= compileLanguage().then((module) => new Language(module));
  try {
    return await language;
  } catch (error) {
    language = null;
    throw error;
  }
}

async function answer(question: PipelineQuestion): Promise<CheckAnswer> {
  try {
    return (await loaded()).checkPipeline(question);
  } catch (error) {
    return { failure: error instanceof Error ? error.message : String(error) };
  }
}

worker.onmessage = ({ data }) => {
  void answer(data).then((told) => worker.postMessage(told));
};
