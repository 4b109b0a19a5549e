/**
 * Builds the viewer's WebAssembly modules with cargo and puts them at `pkg/kernel.wasm` and `pkg/language.wasm`, where vite finds
 * them. A file is written only where it differs, so that a viewer that was built from it stays up to date.
 */
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
for (const name of ["kernel", "language"]) {
  const cargo = spawnSync("cargo", [
    "build", "--quiet", "--profile", "viewer", "--target", "wasm32-unknown-unknown", "--package", "tombolo-viewer-kernel",
    "--no-default-features", "--features", name, "--message-format", "json-render-diagnostics",
  ], { cwd: here("../.."), encoding: "utf8", stdio: ["ignore", "pipe", "inherit"], maxBuffer: 1 << 28 });
  if (cargo.error) throw cargo.error;
  if (cargo.status !== 0) process.exit(cargo.status ?? 1);
  const module = cargo.stdout.split("\n").filter((line) => line.startsWith("{")).map((line) => JSON.parse(line))
    .filter((message) => message.reason === "compiler-artifact" && message.target.name === "tombolo_viewer_kernel")
    .flatMap((message) => message.filenames).find((file) => file.endsWith(".wasm"));
  if (!module) throw new Error("cargo made no module");
  const built = readFileSync(module);
  const target = here(`pkg/${name}.wasm`);
  if (!existsSync(target) || !built.equals(readFileSync(target))) {
    mkdirSync(here("pkg"), { recursive: true });
    writeFileSync(target, built);
    console.log(`viewer/wasm/pkg/${name}.wasm: ${(built.length / 1024).toFixed(0)} KiB`);
  }
}
