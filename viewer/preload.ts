/** Has the browser fetch and read the page's script (`main`) as soon as it reads `index.html`, beside the small one that begins. */
import type { Plugin } from "vite";

export function preload(): Plugin {
  return {
    name: "preload",
    apply: "build",
    transformIndexHtml: {
      order: "post",
      handler: (_, { bundle }) => Object.values(bundle ?? {}).flatMap((file) =>
        file.type === "chunk" && file.name === "main" ? [{ tag: "link", attrs: { rel: "modulepreload", href: `./${file.fileName}`, crossorigin: true }, injectTo: "head" as const }] : []),
    },
  };
}
