import { defineConfig } from "vitest/config";
import { compress } from "./compress.ts";

// Every address is relative, so that the viewer can be served below any path (a reverse proxy, an SSH tunnel).
export default defineConfig({
  base: "./",
  plugins: [compress()],
  build: { target: "es2022", chunkSizeWarningLimit: 2000, assetsInlineLimit: 0 },
  worker: { format: "es" },
  server: { proxy: { "/ws": { target: "ws://127.0.0.1:7070", ws: true } } },
  test: { include: ["test/**/*.test.ts"], environment: "node", testTimeout: 300_000, hookTimeout: 300_000 },
});
