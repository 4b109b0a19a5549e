/**
 * Runs a program that was built for wasm32-wasip1 in Node, as cargo's runner for that target:
 * `CARGO_TARGET_WASM32_WASIP1_RUNNER="node viewer/wasm/wasi.mjs"`. The program sees the directory that it is started in.
 */
import { readFileSync } from "node:fs";
import { setFlagsFromString } from "node:v8";
import { WASI } from "node:wasi";

// Node 20 collects garbage inside such calls, where it must not: what the collector moves or frees is still in use, and Node dies.
setFlagsFromString("--no-turbo-fast-api-calls");

const [program, ...programArguments] = process.argv.slice(2);
if (!program) {
  console.error("usage: node wasi.mjs PROGRAM.wasm [ARGUMENT...]");
  process.exit(2);
}
const wasi = new WASI({
  version: "preview1", args: [program, ...programArguments], env: process.env, preopens: { "/": process.cwd(), ".": process.cwd() }, returnOnExit: true,
});
const module = new WebAssembly.Module(readFileSync(program));
process.exitCode = wasi.start(new WebAssembly.Instance(module, wasi.getImportObject()));
