/** Puts a compressed copy beside every file of the viewer that becomes smaller by it: `name.br` and `name.gz`. */
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";
import type { Plugin } from "vite";

/** Smaller than this a file comes in one packet anyway. */
const LEAST = 1400;
/** A copy that saves less than this part is not worth its place in the program. */
const SAVED = 0.9;

export function compress(): Plugin {
  let directory = "";
  return {
    name: "compress",
    apply: "build",
    configResolved: (config) => { directory = resolve(config.root, config.build.outDir); },
    closeBundle: {
      order: "post",
      handler: () => {
        for (const entry of readdirSync(directory, { recursive: true, withFileTypes: true })) {
          if (!entry.isFile()) continue;
          const file = join(entry.parentPath, entry.name);
          const bytes = readFileSync(file);
          if (bytes.length < LEAST) continue;
          const copies = {
            br: brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 11, [constants.BROTLI_PARAM_LGWIN]: 22, [constants.BROTLI_PARAM_SIZE_HINT]: bytes.length } }),
            gz: gzipSync(bytes, { level: 9 }),
          };
          for (const [ending, copy] of Object.entries(copies)) if (copy.length < SAVED * bytes.length) writeFileSync(`${file}.${ending}`, copy);
        }
      },
    },
  };
}
