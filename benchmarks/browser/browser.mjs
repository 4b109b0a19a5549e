/**
 * Debian's Chromium, whose WebGL a processor draws, and the run that it watches, which TOMBOLO_URL says.
 *
 * CHROMIUM  the browser (default /usr/bin/chromium)
 *
 * Needs the packages of viewer/ (`npm ci` there).
 */
import { createRequire } from "node:module";

const { chromium } = createRequire(new URL("../../viewer/package.json", import.meta.url))("playwright-core");

/** The link that the run printed. */
export const link = process.env.TOMBOLO_URL;
if (!link) throw new Error("TOMBOLO_URL is not set: it is the link that the run printed");

export const openBrowser = () => chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--js-flags=--expose-gc"],
});

/** The bytes of a page's heap after garbage collection. */
export const heap = (page) => page.evaluate(() => {
  window.gc();
  return performance.memory.usedJSHeapSize;
});
