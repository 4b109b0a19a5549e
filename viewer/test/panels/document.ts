/** The page's own document, for tests of panels. */
import { readFileSync } from "node:fs";

export function openDocument(): void {
  const html = readFileSync("index.html", "utf8");
  document.body.innerHTML = /<body>([\s\S]*)<\/body>/.exec(html)![1]!;
}
