/**
 * Runs the viewer's module in Node on a surface and stacks of edits, to compare its numbers and its time with the native kernel's:
 *
 *   node viewer/wasm/run.mjs MODULE.wasm SURFACE STACKS.json [DISPLACEMENTS]
 *
 * SURFACE is a frame of kind 3, STACKS a list of stacks. The displacements are written one after the other, as doubles. What it
 * took is printed as JSON, in seconds: `compile` the module, `rehearse` as the viewer does when it loads, `open` the surface, and
 * each stack. With REHEARSE=0 in the environment nothing is rehearsed.
 */
import { readFileSync, writeFileSync } from "node:fs";

const [modulePath, surfacePath, stacksPath, outputPath] = process.argv.slice(2);
const seconds = (action) => {
  const start = performance.now();
  const result = action();
  return [result, (performance.now() - start) / 1000];
};
const [exports, compile] = seconds(() => new WebAssembly.Instance(new WebAssembly.Module(readFileSync(modulePath))).exports);
const bytes = (index) => {
  const start = exports.array(index) >>> 0;
  return Buffer.from(exports.memory.buffer.slice(start, start + exports.array_bytes(index)));
};
const call = (input, run) => {
  const at = exports.input(input.length) >>> 0;
  new Uint8Array(exports.memory.buffer, at, input.length).set(input);
  const result = run() >>> 0;
  if (result === 0) throw new Error(bytes(0).toString());
  return result;
};

const rehearse = process.env["REHEARSE"] === "0" ? 0 : seconds(() => exports.rehearse())[1];
// What the engine compiles well it compiles on threads of its own, a moment later.
await new Promise((resolve) => setTimeout(resolve, 300));

const frame = readFileSync(surfacePath);
const [surface, open] = seconds(() => call(frame, () => exports.open_surface()));
const displacements = [];
const stacks = JSON.parse(readFileSync(stacksPath, "utf8")).map((stack) => {
  const [displacement, time] = seconds(() => {
    call(Buffer.from(JSON.stringify(stack)), () => exports.displacement(surface));
    return bytes(0);
  });
  if (outputPath) displacements.push(displacement);
  return time;
});
if (outputPath) writeFileSync(outputPath, Buffer.concat(displacements));
console.log(JSON.stringify({ compile, rehearse, open, stacks, memory: exports.memory.buffer.byteLength }));
