/** The kernel's module as `wasm/build.mjs` made it. */
import { readFileSync } from "node:fs";

export const wasm = new WebAssembly.Module(readFileSync(new URL("../wasm/pkg/kernel.wasm", import.meta.url)));
