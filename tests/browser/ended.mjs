/**
 * Watches a run that comes to its own end, in Debian's Chromium: the page says so, keeps the picture, offers nothing more, and does not
 * ask for the run again.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/ended.mjs
 *
 * The variables are those of page.mjs.
 */
import { Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "ended");
const steps = [
  ["a run that has taken its steps is said to have ended", async () => {
    await viewer.page.goto(link);
    await viewer.until("a first picture", (now) => now.frames > 0);
    const { end } = await viewer.until("the end", (now) => now.end !== null);
    // A page that tries again does so within a third of a second.
    await viewer.page.waitForTimeout(1500);
    const seen = await viewer.look();
    check(end.how === "finished" && seen.connection === "ended", `the page shows ${JSON.stringify(seen.end)}, ${seen.connection}`);
    const words = await viewer.text("#banner");
    check(words.trim() === `The run ended at cycle ${end.cycle}: steps reached. The picture stays as it was.`, `the banner says "${words}"`);
    check((await viewer.text("#run")) === "ended: steps reached", `the run is "${await viewer.text("#run")}"`);
    check(await viewer.page.locator("#retry").isHidden(), "it offers to try again");
    for (const selector of ["#apply", "#undo", "#redo", "#pause"]) check(await viewer.page.locator(selector).isDisabled(), `${selector} can be pressed after the end`);
    check((await viewer.drawn()).cycle !== null && seen.errors.length === 0, `the picture is gone, or ${JSON.stringify(seen.errors)}`);
    await viewer.picture("ended");
    await viewer.clean("ended");
    check(viewer.complaints.length === 0, viewer.complaints.join("\n"));
  }],
];
await run(steps, () => [viewer], () => browser.close());
