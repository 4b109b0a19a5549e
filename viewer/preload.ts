/**
 * Has `index.html` name what the page needs at once beside the small script that begins, so that the browser fetches all of it together: the
 * page's own script (`main`), which the small one imports, and the geometry kernel, which it compiles. A page that has loaded has run both
 * scripts.
 */
import type { HtmlTagDescriptor, Plugin } from "vite";

export function preload(): Plugin {
  return {
    name: "preload",
    apply: "build",
    transformIndexHtml: {
      order: "post",
      handler: (_, { bundle }) => Object.values(bundle ?? {}).flatMap((file): HtmlTagDescriptor[] => {
        const address = `./${file.fileName}`;
        if (file.type === "chunk") return file.name === "main" ? [{ tag: "script", attrs: { type: "module", crossorigin: true, src: address }, injectTo: "head" }] : [];
        // The policy before it is asked whether it may be fetched.
        return /\bkernel-[^/]*\.wasm$/.test(file.fileName)
          ? [{ tag: "link", attrs: { rel: "preload", as: "fetch", type: "application/wasm", crossorigin: true, href: address }, injectTo: "head" }] : [];
      }),
    },
  };
}
