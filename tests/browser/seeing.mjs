/**
 * Looks at a running nozzle as a person would, in Debian's Chromium: on a narrow page and a wide one, in light and dark; moves the
 * camera, a slice and the range of the colours, reads and pins a place, and reloads.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/seeing.mjs
 *
 * TOMBOLO_URL          the link that the run printed (needed)
 * TOMBOLO_SCREENSHOTS  the directory for the screenshots (default: none are taken)
 * TOMBOLO_SECONDS      how long to wait for anything, which only a fault makes it come to (default 600)
 * CHROMIUM             the browser (default /usr/bin/chromium)
 *
 * Needs the packages of viewer/ (`npm ci` there). Exits with 0 when all of it holds.
 */
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(new URL("../../viewer/package.json", import.meta.url));
const { chromium } = require("playwright-core");
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

const link = process.env.TOMBOLO_URL;
if (!link) {
  console.error("TOMBOLO_URL is not set: it is the link that the running demo printed");
  process.exit(2);
}
const patience = Number(process.env.TOMBOLO_SECONDS ?? 600) * 1000;
class Failure extends Error {}
const check = (holds, message) => {
  if (!holds) throw new Failure(message);
};

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync"],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: "dark", bypassCSP: true });
page.setDefaultTimeout(patience);
const complaints = [];
page.on("pageerror", (error) => complaints.push(`the page failed: ${error.message}`));
let wire = 0;
const network = await page.context().newCDPSession(page);
await network.send("Network.enable");
network.on("Network.loadingFinished", ({ encodedDataLength }) => { wire += encodedDataLength; });

const until = (what, condition, argument) => page.waitForFunction(condition, argument, { timeout: patience, polling: 100 })
  .catch(() => { throw new Failure(`${what}: not within ${patience / 1000} s`); });
const drawn = () => page.evaluate(() => window.tombolo.picture());
const place = () => page.evaluate(() => window.tombolo.featurePlace("throat"));
const upstream = () => page.evaluate(() => window.tombolo.featurePlace("upstream"));
let pictures = 0;
const picture = async (name) => {
  if (process.env.TOMBOLO_SCREENSHOTS) await page.screenshot({ path: join(process.env.TOMBOLO_SCREENSHOTS, `seeing-${++pictures}-${name}.png`) });
};
/** What axe finds wrong with the page as it is. */
const violations = () => page.evaluate(async (source) => {
  if (!window.axe) (0, eval)(source);
  const { violations: found } = await window.axe.run(document, { resultTypes: ["violations"] });
  return found.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target.join(" ")).slice(0, 5).join(", ")}`);
}, axe);
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
      const [at, before] = [await place(), await upstream()];
      check(at && before, "the throat cannot be seen");
      await page.mouse.move(...at);
      await page.mouse.down({ button });
      await page.mouse.move(at[0] + 40, at[1] + 30, { steps: 4 });
      await page.mouse.up({ button });
      await drawn();
      // The throat lies in the middle, where zooming moves nothing.
      const after = await upstream();
      check(after && Math.hypot(after[0] - before[0], after[1] - before[1]) > 5, `a ${button} drag left the upstream wall at ${after}`);
      await page.click('[data-camera="reset"]');
    }
    check((await page.evaluate(() => window.tombolo.selection.handle.length)) === 0, "a drag chose a handle");
  }],
  ["the place under the pointer is read, and pinned into the plot", async () => {
    await drawn();
    await page.mouse.move(...(await place()));
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
    await picture("light");
  }],
  ["nobody is kept out, in light and in dark", async () => {
    for (const theme of ["light", "dark"]) {
      const found = await violations();
      check(found.length === 0, `${theme}: ${found.join("; ")}`);
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
  ["nothing went wrong on the way", async () => check(complaints.length === 0, complaints.join("\n"))],
];

let failed = false;
for (const [name, run] of steps) {
  const start = Date.now();
  try {
    await run();
    console.log(`ok      ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed = true;
    console.error(`FAILED  ${name}: ${error instanceof Failure ? error.message : error.stack}`);
    if (complaints.length) console.error(complaints.join("\n"));
    if (!process.env.TOMBOLO_GO_ON) break;
  }
}
await browser.close();
process.exitCode = failed ? 1 : 0;
