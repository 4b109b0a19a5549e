/** The modules as `wasm/build.mjs` made them. */
import { readFileSync } from "node:fs";

const compiled = (name: string): WebAssembly.Module => new WebAssembly.Module(readFileSync(new URL(`../wasm/pkg/${name}.wasm`, import.meta.url)));

export const wasm = compiled("kernel");
export const languageWasm = compiled("language");
