/**
 * Builds the viewer's WebAssembly module with cargo and puts it at `pkg/kernel.wasm`, where vite finds it. The file is written
 * only where it differs, so that a viewer that was built from it stays up to date.
 */
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const cargo = spawnSync("cargo", [
  "build", "--quiet", "--profile", "viewer", "--target", "wasm32-unknown-unknown", "--package", "tombolo-viewer-kernel",
  "--message-format", "json-render-diagnostics",
], { cwd: here("../.."), encoding: "utf8", stdio: ["ignore", "pipe", "inherit"], maxBuffer: 1 << 28 });
if (cargo.error) throw cargo.error;
if (cargo.status !== 0) process.exit(cargo.status ?? 1);
const module = cargo.stdout.split("\n").filter((line) => line.startsWith("{")).map((line) => JSON.parse(line))
  .filter((message) => message.reason === "compiler-artifact" && message.target.name === "tombolo_viewer_kernel")
  .flatMap((message) => message.filenames).find((name) => name.endsWith(".wasm"));
if (!module) throw new Error("cargo made no module");
const built = readFileSync(module);
const target = here("pkg/kernel.wasm");
if (!existsSync(target) || !built.equals(readFileSync(target))) {
  mkdirSync(here("pkg"), { recursive: true });
  writeFileSync(target, built);
  console.log(`viewer/wasm/pkg/kernel.wasm: ${(built.length / 1024).toFixed(0)} KiB`);
}
