/**
 * The browser of the tests (tests/browser/chromium.mjs), the heap of its pages, and the run that it watches, which TOMBOLO_URL says.
 */
import { launch } from "../../tests/browser/chromium.mjs";

/** The link that the run printed. */
export const link = process.env.TOMBOLO_URL;
if (!link) throw new Error("TOMBOLO_URL is not set: it is the link that the run printed");

export const openBrowser = () => launch();

/**
 * The bytes of a page's heap, what lies in array buffers and what the page is made of with it: `held` after garbage collection, and
 * `uncollected` before it. The browser's own collection is asked for: a page's `gc()` leaves array buffers that nobody holds any more to
 * be freed later, and `performance.memory` counts those, in steps of its own.
 */
export async function heap(page) {
  const session = await page.context().newCDPSession(page);
  const bytes = async () => {
    const { usedSize, embedderHeapUsedSize, backingStorageSize } = await session.send("Runtime.getHeapUsage");
    return usedSize + embedderHeapUsedSize + backingStorageSize;
  };
  const uncollected = await bytes();
  await session.send("HeapProfiler.collectGarbage");
  const held = await bytes();
  await session.detach();
  return { held, uncollected };
}
