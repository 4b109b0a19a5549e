/**
 * Watches the run at TOMBOLO_URL in Debian's Chromium for TOMBOLO_MINUTES and prints one line of JSON: the bytes of the page's heap after
 * each minute, those held and those not yet collected, and how many frames it was shown. The picture is turned a little now and then, as somebody does who watches.
 */
import { heap, link, openBrowser } from "./browser.mjs";

const MINUTES = Number(process.env.TOMBOLO_MINUTES ?? 30);

const browser = await openBrowser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  await page.goto(link);
  await page.waitForFunction(() => window.tombolo?.frames > 0);
  const heaps = [];
  for (let minute = 0; minute < MINUTES; minute++) {
    for (let turn = 0; turn < 6; turn++) {
      await page.waitForTimeout(10_000);
      await page.focus("#scene");
      await page.keyboard.press("ArrowLeft");
    }
    heaps.push(await heap(page));
  }
  const { frames, errors } = await page.evaluate(() => ({ frames: window.tombolo.frames, errors: window.tombolo.errors }));
  if (errors.length > 0) throw new Error(`the page had errors: ${errors.join("; ")}`);
  console.log(JSON.stringify({ held: heaps.map(({ held }) => held), uncollected: heaps.map(({ uncollected }) => uncollected), frames }));
} finally {
  await browser.close();
}
