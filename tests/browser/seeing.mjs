/**
 * Looks at a running nozzle as a person would, in Debian's Chromium: on a narrow page and a wide one, in light and dark; moves the
 * camera, a slice and the range of the colours, reads and pins a place, reloads, and turns a picture of very many triangles.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/seeing.mjs
 *
 * The variables are those of page.mjs.
 */
import { Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "seeing", { colorScheme: "dark" });
const { page } = viewer;
let wire = 0;
const network = await page.context().newCDPSession(page);
await network.send("Network.enable");
network.on("Network.loadingFinished", ({ encodedDataLength }) => { wire += encodedDataLength; });

/** How many triangles each picture was drawn with, the newest last. */
await page.addInitScript(() => {
  window.pictures = [];
  let triangles = null;
  const count = (mode, corners) => {
    if (mode !== WebGL2RenderingContext.TRIANGLES) return;
    if (triangles === null) queueMicrotask(() => {
      window.pictures = [...window.pictures.slice(-50), triangles];
      triangles = null;
    });
    triangles += corners / 3;
  };
  const { drawArrays, drawElements } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.drawArrays = function (mode, first, corners) {
    count(mode, corners);
    return drawArrays.call(this, mode, first, corners);
  };
  WebGL2RenderingContext.prototype.drawElements = function (mode, corners, type, offset) {
    count(mode, corners);
    return drawElements.call(this, mode, corners, type, offset);
  };
});

const until = (what, condition, argument) => viewer.holds(what, condition, argument);
const drawn = () => viewer.drawn();
const picture = (name) => viewer.picture(name);
const bounds = () => page.evaluate(() => window.tombolo.views.midplane.bounds);

const steps = [
  ["the first picture comes with little on the wire", async () => {
    await page.goto(link);
    await until("a first picture", () => window.tombolo?.frames > 0);
    await drawn();
    check(wire < 700_000, `${wire} bytes came before the first picture`);
    await picture("wide");
  }],
  ["middle and right drags move the camera, and choose nothing", async () => {
    for (const button of ["middle", "right"]) {
      const [at, before] = [await viewer.place("throat"), await viewer.place("upstream")];
      check(at && before, "the throat cannot be seen");
      await page.mouse.move(...at);
      await page.mouse.down({ button });
      await page.mouse.move(at[0] + 40, at[1] + 30, { steps: 4 });
      await page.mouse.up({ button });
      await drawn();
      // The throat lies in the middle, where zooming moves nothing.
      const after = await viewer.place("upstream");
      check(after && Math.hypot(after[0] - before[0], after[1] - before[1]) > 5, `a ${button} drag left the upstream wall at ${after}`);
      await page.click('[data-camera="reset"]');
    }
    check((await page.evaluate(() => window.tombolo.selection.handle.length)) === 0, "a drag chose a handle");
  }],
  ["a short drag moves the picture a short way, however finely it is drawn", async () => {
    const before = await viewer.place("throat");
    await page.mouse.move(...before);
    await page.mouse.down({ button: "middle" });
    await page.mouse.move(before[0] + 4, before[1], { steps: 2 });
    await page.mouse.up({ button: "middle" });
    await drawn();
    const after = await viewer.place("throat");
    check(after && Math.hypot(after[0] - before[0], after[1] - before[1]) < 20, `a drag of 4 pixels took the throat from ${before} to ${after}`);
    await page.click('[data-camera="reset"]');
  }],
  ["the place under the pointer is read, and pinned into the plot", async () => {
    await drawn();
    await page.mouse.move(...(await viewer.place("throat")));
    await until("the value beside the pointer", () => /^throat[\s\S]*velocity magnitude [\d.]+/.test(document.getElementById("tip").textContent));
    await page.keyboard.press("p");
    await until("the pin in the picture", () => document.querySelectorAll("#marks circle.probe").length === 1);
    await until("the pin in the plot", () => [...document.querySelectorAll("#dock tbody th")].some((name) => /velocity magnitude/.test(name.textContent)));
    await picture("pinned");
  }],
  ["a number typed at the end of a bar fixes the range", async () => {
    await page.fill('.scalar-bar input[aria-label$="highest value"]', "5");
    await page.keyboard.press("Enter");
    await until("the fixed range", () => [...document.querySelectorAll("#look select")].some((select) => select.value === "fixed"));
    check((await page.inputValue('.scalar-bar input[aria-label$="highest value"]')) === "5", "the bar does not end at 5");
  }],
  ["a slice is moved by axis and number", async () => {
    await page.click('#slice .axes button:nth-child(2)');
    await until("a cut across y", () => { const [low, high] = window.tombolo.views.midplane.bounds; return high[1] - low[1] < 1e-3; });
    await page.fill("#slice input[type=text]", "0.2");
    await page.keyboard.press("Enter");
    await until("the cut at 0.2", () => Math.abs(window.tombolo.views.midplane.bounds[0][1] - 0.2) < 1e-3);
    check(Math.abs((await bounds())[1][1] - 0.2) < 1e-3, `the slice lies at ${JSON.stringify(await bounds())}`);
    await picture("slice");
  }],
  ["what was chosen comes back with a reload", async () => {
    await page.click("#theme");
    await page.reload();
    await until("a picture again", () => window.tombolo?.frames > 0);
    check((await page.evaluate(() => document.documentElement.dataset.theme)) === "light", "the theme was forgotten");
    check(await page.evaluate(() => [...document.querySelectorAll("#look select")].some((select) => select.value === "fixed")), "the range was forgotten");
    // The pin is looked for anew; as long as there is one, its view is sent.
    await until("the pin again", () => document.querySelectorAll("#marks circle.probe").length === 1);
    await until("what it had read", () => [...document.querySelectorAll("#dock .choices label")].some((name) => /^probe 1: velocity magnitude/.test(name.textContent)));
    await picture("light");
    await page.locator("#scene").press("Shift+P");
    await until("no pin", () => document.querySelectorAll("#marks circle.probe").length === 0);
  }],
  ["a view that is hidden is not sent, and comes back when it is shown", async () => {
    const cycles = () => page.evaluate(() => Object.fromEntries(Object.entries(window.tombolo.views).map(([name, { cycle }]) => [name, cycle])));
    const shown = page.locator('[data-view="midplane"] input[type=checkbox]');
    await shown.uncheck();
    await page.click('[data-view="surface"] .choose');
    // A frame may have been on its way.
    const asked = (await cycles()).surface;
    await until("frames of the surface", (cycle) => window.tombolo.views.surface.cycle >= cycle + 10, asked);
    const before = await cycles();
    await until("more frames of the surface", (cycle) => window.tombolo.views.surface.cycle >= cycle + 20, before.surface);
    check((await cycles()).midplane === before.midplane, `the hidden view went on from ${before.midplane} to ${(await cycles()).midplane}`);
    await shown.check();
    await until("the view again", (cycle) => window.tombolo.views.midplane.cycle > cycle, before.midplane);
    await page.click('[data-view="midplane"] .choose');
  }],
  ["nobody is kept out, in light and in dark", async () => {
    for (const theme of ["light", "dark"]) {
      await viewer.clean(`in ${theme}`);
      await page.click("#theme");
    }
    const small = await page.evaluate(() => [...document.querySelectorAll("button, input:not([type=checkbox]), select, summary")]
      .filter((control) => control.checkVisibility({ visibilityProperty: true }) && !control.classList.contains("skip")).map((control) => [control.id || control.className || control.textContent, control.getBoundingClientRect().height])
      .filter(([, height]) => height < 24));
    check(small.length === 0, `lower than 24 px: ${JSON.stringify(small)}`);
  }],
  ["a narrow page is all picture, with drawers", async () => {
    await page.setViewportSize({ width: 820, height: 1180 });
    await drawn();
    const inside = (selector) => page.evaluate((name) => {
      const { left, right, top, bottom } = document.querySelector(name).getBoundingClientRect();
      return left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight;
    }, selector);
    check((await page.evaluate(() => document.getElementById("scene").clientWidth)) === 820, "the picture is not as wide as the page");
    check(await inside("#pause"), "Pause is cut off");
    check(!(await page.isVisible("#apply")), "a drawer is open");
    await page.click("#right-drawer");
    check(await inside("#apply"), "Apply is not to be seen in its drawer");
    await picture("narrow");
    await page.click("#right-drawer");
    await page.click("#keys-button");
    check(await page.isVisible("#keys"), "the sheet of keys does not open");
    await page.keyboard.press("Escape");
  }],
  ["very many triangles are drawn coarsely while the picture is turned, and in full once it rests", async () => {
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.click("#pipeline-add");
    await page.click('[data-template="slice"]');
    await page.waitForSelector("#pipeline-text .cm-content");
    const planes = Array.from({ length: 32 }, (_, i) => ({ origin: [0, 0, -0.045 + (0.09 * i) / 31], normal: [0, 0, 1] }));
    const stages = [{ slice: { planes } }, { select: { fields: ["velocity"] } }, { stream: { error: { relative: 1e-3 } } }];
    await page.click("#pipeline-text .cm-content");
    await page.keyboard.press("Control+a");
    await page.keyboard.insertText(JSON.stringify({ name: "many", every: { steps: 5 }, stages }));
    await until("no errors", () => /No errors/.test(document.getElementById("pipeline-state").textContent));
    await page.keyboard.press("Control+Enter");
    const triangles = await until("very many triangles", () => window.tombolo.views.many?.cycle !== null && window.tombolo.views.many?.triangles > 100_000 && window.tombolo.views.many.triangles);
    await drawn();
    // Their clusters are found on the way, beside the picture.
    await until("a coarse picture", (all) => {
      document.getElementById("scene").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
      return window.pictures.at(-1) < all / 2;
    }, triangles);
    await until("a picture in full", (all) => window.pictures.at(-1) >= all, triangles);
    await picture("very-many");
    await page.click("#pipeline-close");
    for (const button of ["icon", "small"]) await page.click(`#pipelines li[data-pipeline="many"] .${button}[data-act="remove"]`);
    await until("the view gone", () => !("many" in window.tombolo.views));
  }],
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

await run(steps, () => [viewer], () => browser.close());
