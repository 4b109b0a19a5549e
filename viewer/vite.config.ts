import { defineConfig } from "vitest/config";
import { compress } from "./compress.ts";
import { preload } from "./preload.ts";

// Every address is relative, so that the viewer can be served below any path (a reverse proxy, an SSH tunnel).
export default defineConfig({
  base: "./",
  plugins: [preload(), compress()],
  build: { target: "es2022", chunkSizeWarningLimit: 2000, assetsInlineLimit: 0, cssCodeSplit: false },
  worker: { format: "es" },
  server: { proxy: { "/ws": { target: "ws://127.0.0.1:7070", ws: true } } },
  test: { include: ["test/**/*.test.ts"], environment: "node", testTimeout: 300_000, hookTimeout: 300_000 },
});
