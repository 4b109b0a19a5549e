/**
 * The browser of the tests (tests/browser/chromium.mjs), whose heap can be measured, and the run that it watches, which TOMBOLO_URL says.
 */
import { launch } from "../../tests/browser/chromium.mjs";

/** The link that the run printed. */
export const link = process.env.TOMBOLO_URL;
if (!link) throw new Error("TOMBOLO_URL is not set: it is the link that the run printed");

export const openBrowser = () => launch("--js-flags=--expose-gc");

/** The bytes of a page's heap after garbage collection. */
export const heap = (page) => page.evaluate(() => {
  window.gc();
  return performance.memory.usedJSHeapSize;
});
