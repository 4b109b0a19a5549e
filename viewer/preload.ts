/**
 * Has `index.html` name the page's own script (`main`) too, behind the small one that begins and imports it: the browser fetches both at
 * once, and a page that has loaded has run both.
 */
import type { Plugin } from "vite";

export function preload(): Plugin {
  return {
    name: "preload",
    apply: "build",
    transformIndexHtml: {
      order: "post",
      handler: (_, { bundle }) => Object.values(bundle ?? {}).flatMap((file) =>
        file.type === "chunk" && file.name === "main" ? [{ tag: "script", attrs: { type: "module", crossorigin: true, src: `./${file.fileName}` }, injectTo: "head" as const }] : []),
    },
  };
}
