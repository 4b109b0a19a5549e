/** The checker of the language: a WebAssembly module of the code by which the run reads its pipelines (`viewer/wasm`). */
import type { Json } from "../connection/protocol";
import { Module, compile, encoder } from "./module";
import type { Border } from "./module";

/** Something wrong with a text; `line` and `column` count characters from 1. */
export interface LanguageError { line: number; column: number; path: string; message: string; suggestion: string | null }

/** The text of a pipeline, and the run that it is for; `replaced` is the name of the pipeline that it takes the place of. */
export interface PipelineQuestion { text: string; replaced: string | null; pipelines: readonly Json[]; parameters: readonly string[] }

/** The errors in the order of the text, and how many more there are. */
export interface PipelineErrors { errors: LanguageError[]; more: number }

interface Exports extends Border {
  check_pipeline(): number;
}

export const compileLanguage = (): Promise<WebAssembly.Module> => compile(new URL("../../wasm/pkg/language.wasm", import.meta.url), "the checker");

export class Language extends Module<Exports> {
  constructor(module: WebAssembly.Module) {
    super(module, "the checker");
  }

  /** All that would keep the run from taking a pipeline; none where it takes it. */
  checkPipeline({ text, replaced, pipelines, parameters }: PipelineQuestion): PipelineErrors {
    const input = encoder.encode(JSON.stringify({ text, replaced, pipelines, parameters }));
    return this.call([input], (exports) => exports.check_pipeline(), () => JSON.parse(this.text(0)) as PipelineErrors).answer;
  }
}
