/**
 * What the tests in a browser share: Debian's Chromium, a page of the viewer, waiting for what it shows, and steps that are run one
 * after the other until one fails. Needs the packages of viewer/ (`npm ci` there).
 *
 * TOMBOLO_URL          the link that the run printed (needed)
 * TOMBOLO_SCREENSHOTS  the directory for the screenshots (default: a new one in the directory for temporary files)
 * TOMBOLO_GALLERY      the directory for those of docs/gallery.md (default: target/gallery)
 * TOMBOLO_SECONDS      how long to wait for anything, which only a fault makes it come to (default 600)
 * CHROMIUM             the browser (default /usr/bin/chromium)
 */
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export { launch } from "./chromium.mjs";

const axe = readFileSync(createRequire(new URL("../../viewer/package.json", import.meta.url)).resolve("axe-core/axe.min.js"), "utf8");

export class Failure extends Error {}
export const check = (holds, message) => {
  if (!holds) throw new Failure(message);
};

/** The link to the run. */
export const link = process.env.TOMBOLO_URL;
if (!link) {
  console.error("TOMBOLO_URL is not set: it is the link that the run printed");
  process.exit(2);
}
export const patience = Number(process.env.TOMBOLO_SECONDS ?? 600) * 1000;
export const screenshots = process.env.TOMBOLO_SCREENSHOTS ?? mkdtempSync(join(tmpdir(), "tombolo-browser-"));
const gallery = process.env.TOMBOLO_GALLERY ?? fileURLToPath(new URL("../../target/gallery", import.meta.url));
for (const directory of [screenshots, gallery]) mkdirSync(directory, { recursive: true });

/** The sizes of page that a task is filmed at; the last is that of a page that is opened. */
const SIZES = [[1920, 1080], [820, 1180], [1280, 800]];
const WIDEST = Math.max(...SIZES.map(([width]) => width));

/** A viewer in a browser of its own, as another person has one. */
export class Viewer {
  /** `options` are those of a browser context, such as its viewport. */
  static async open(browser, name, options = {}) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
    const viewer = new Viewer(name, await context.newPage());
    // What the page's own policy has refused counts as a complaint, with the rule that it broke.
    await viewer.page.addInitScript(() => document.addEventListener("securitypolicyviolation", ({ effectiveDirective, blockedURI }) => console.error(`the policy "${effectiveDirective}" has refused ${blockedURI}`)));
    return viewer;
  }

  constructor(name, page) {
    this.name = name;
    this.page = page;
    this.complaints = [];
    this.pictures = 0;
    this.isWidestClean = false;
    page.setDefaultTimeout(patience);
    page.on("pageerror", (error) => this.complaints.push(`${name}: the page failed: ${error.message}`));
    page.on("console", (message) => {
      // The browser itself reports connections that are cut, and looks for an icon where it is shown plain text.
      if (["error", "warning"].includes(message.type()) && !/WebSocket|ERR_|favicon|GPU stall|GL Driver|status of 401/.test(`${message.text()} ${message.location().url}`)) this.complaints.push(`${name}: ${message.text()}`);
    });
  }

  look() {
    return this.page.evaluate(() => {
      const { connection, role, cycle, frames, orders, status, quality, stack, selection, preview, forecast, errors, end, views } = window.tombolo;
      return { connection, role, cycle, frames, orders, status, quality, stack, selection, preview, forecast, errors, end, views };
    });
  }

  /** Waits until `condition` of what the viewer shows holds. */
  async until(what, condition) {
    const end = Date.now() + patience;
    for (;;) {
      const seen = await this.look();
      if (await condition(seen)) return seen;
      if (Date.now() > end) throw new Failure(`${this.name}: ${what}: not within ${patience / 1000} s. It shows ${JSON.stringify(seen, null, 1)}`);
      await this.page.waitForTimeout(100);
    }
  }

  drawn() {
    return this.page.evaluate(() => window.tombolo.picture());
  }

  /** How many pixels of the picture, without what lies over it, are about of a colour; all that has come is drawn before. */
  async pixelsOf(colour, tolerance = 40) {
    await this.drawn();
    const png = (await this.page.locator("#scene").screenshot({ style: "#stage > :not(#scene), #tools { visibility: hidden }" })).toString("base64");
    return this.page.evaluate(async ([data, wanted, most]) => {
      const image = Object.assign(new Image(), { src: `data:image/png;base64,${data}` });
      await image.decode();
      const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
      const context = canvas.getContext("2d");
      context.drawImage(image, 0, 0);
      const pixels = context.getImageData(0, 0, image.width, image.height).data;
      let count = 0;
      for (let at = 0; at < pixels.length; at += 4) if (wanted.every((part, k) => Math.abs(pixels[at + k] - part) <= most)) count++;
      return count;
    }, [png, colour, tolerance]);
  }

  /** The controls that are lower or narrower than the 24 pixels that a finger needs; a label that is as large does for its control. */
  small() {
    return this.page.evaluate(() => [...document.querySelectorAll("button, input, select, textarea, summary, [role=tab], a[href]")]
      .filter((control) => control.checkVisibility({ visibilityProperty: true }) && !control.classList.contains("skip"))
      .flatMap((control) => {
        const boxes = [control, ...(control.labels ?? [])].map((part) => part.getBoundingClientRect());
        const [box] = boxes;
        return boxes.some(({ width, height }) => width >= 24 && height >= 24) ? [] : [`${control.id || control.getAttribute("aria-label") || control.textContent} ${Math.round(box.width)} x ${Math.round(box.height)}`];
      }));
  }

  text(selector) {
    return this.page.locator(selector).innerText();
  }

  /** Keeps what the page looks like; also as the picture `shown` of the gallery, where that is given. */
  async picture(name, shown) {
    const path = join(screenshots, `${this.name}-${String(++this.pictures).padStart(2, "0")}-${name}.png`);
    await this.page.screenshot({ path });
    if (shown) copyFileSync(path, join(gallery, shown));
  }

  /** Waits until something that is evaluated in the page holds; gives back its value. */
  async holds(what, condition, argument) {
    const found = await this.page.waitForFunction(condition, argument, { timeout: patience, polling: 100 })
      .catch(() => { throw new Failure(`${this.name}: ${what}: not within ${patience / 1000} s`); });
    return found.jsonValue();
  }

  /** A place of the page at which a feature is seen. */
  place(feature) {
    return this.page.evaluate((name) => window.tombolo.featurePlace(name), feature);
  }

  /** What axe finds wrong with the page as it is. */
  async violations() {
    // Evaluated by the debugger, which the page's own policy does not hold back.
    if (!(await this.page.evaluate(() => "axe" in window))) await this.page.evaluate(axe);
    return this.page.evaluate(async () => {
      const { violations } = await window.axe.run(document, { resultTypes: ["violations"] });
      return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target.join(" ")).slice(0, 5).join(", ")}`);
    });
  }

  /** Checks that axe finds nothing wrong with the page as it is. */
  async clean(state) {
    const found = await this.violations();
    check(found.length === 0, `${this.name}, ${state}: axe finds ${found.join("; ")}`);
  }

  /**
   * Keeps what the page looks like at three sizes, with a drawer open where the page is narrow; nobody is kept out of any. On the widest
   * there is little that axe would not see on the last: it looks there once.
   */
  async filmed(name, drawer = null) {
    for (const [width, height] of SIZES) {
      await this.page.setViewportSize({ width, height });
      const isNarrow = width <= 1100;
      if (isNarrow && drawer) await this.page.click(`#${drawer}-drawer`);
      await this.drawn();
      await this.picture(`${name}-${width}`);
      if (width < WIDEST || !this.isWidestClean) await this.clean(`${name} at ${width} x ${height}`);
      if (width === WIDEST) this.isWidestClean = true;
      if (isNarrow && drawer) await this.page.click(`#${drawer}-drawer`);
    }
  }

  /** A number of the edit that is in the form. */
  field(label) {
    return this.page.locator(`.object:not([hidden]) input[aria-label="${label}"]`);
  }

  /** Sets how many shapes the order in the form has, and the cycles between them. */
  async scheduled(shapes, every) {
    const steps = this.page.getByLabel("schedule steps", { exact: true });
    if (!(await steps.isVisible())) await this.page.click(".schedule summary");
    await steps.fill(String(shapes));
    await this.page.getByLabel("schedule every", { exact: true }).first().fill(String(every));
  }

  /** The extent of a feature along an axis, as it is now. */
  extent(name, axis) {
    return this.page.evaluate(([feature, k]) => {
      const box = window.tombolo.featureBounds(feature);
      return box && box[1][k] - box[0][k];
    }, [name, axis]);
  }

  /** Applies what stands in the form, and waits until the order has come to its end. */
  async apply() {
    const known = new Set((await this.look()).orders.map((order) => order.id));
    await this.page.click("#apply");
    return this.settled(known);
  }

  /** Waits until an order that is not known yet has come to its end. */
  async settled(known) {
    const seen = await this.until("an order at its end", (now) => now.orders.some((order) => !known.has(order.id) && ["applied", "rejected"].includes(order.status)));
    return seen.orders.find((order) => !known.has(order.id));
  }
}

/** What fingers do on a page that has touch: told to the browser, which makes of it what it makes of real ones. */
export class Fingers {
  constructor({ page }) {
    this.page = page;
    this.session = page.context().newCDPSession(page);
  }

  /** Where the page is narrow: has this drawer open, and no other; none without a name. */
  async drawer(side = "") {
    const open = await this.page.evaluate(() => document.body.dataset.drawer ?? "");
    const button = `#${side || open}-drawer`;
    if (side !== open && (await this.page.locator(button).isVisible())) await this.tap(button);
  }

  /** Taps an element, in the drawer that it lies in. */
  async press(selector) {
    await this.drawer(await this.page.evaluate((wanted) => document.querySelector(wanted)?.closest("#left, #right")?.id, selector));
    await this.tap(selector);
  }

  /** Taps an element that is in sight. The finger is lifted whether or not the page has answered yet: where it rests, nothing is clicked. */
  async tap(selector) {
    const locator = this.page.locator(selector);
    await locator.tap({ trial: true });
    const { x, y, width, height } = await locator.boundingBox();
    await this.page.evaluate((wanted) => {
      window.isTapped = false;
      document.querySelector(wanted).addEventListener("click", () => { window.isTapped = true; }, { once: true, capture: true });
    }, selector);
    const session = await this.session;
    await Promise.all([
      session.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [{ x: x + width / 2, y: y + height / 2 }] }),
      session.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] }),
    ]);
    await this.page.waitForFunction(() => window.isTapped, null, { timeout: 60000 }).catch(() => { throw new Failure(`a tap on ${selector} clicks nothing`); });
  }

  /** Writes into a field as the keyboard of a screen does: the text comes, and no keys. */
  async write(selector, text) {
    await this.press(selector);
    await this.page.locator(selector).fill(String(text));
  }

  /** Goes from a place of the page by so much. */
  async drag(from, by) {
    await this.spread([from], [by]);
  }

  /** Each finger goes from its place of the page by so much, all at once. */
  async spread(from, by, parts = 6) {
    const at = (part) => from.map(([x, y], id) => ({ id, x: x + (by[id][0] * part) / parts, y: y + (by[id][1] * part) / parts }));
    const touch = async (type, touchPoints) => (await this.session).send("Input.dispatchTouchEvent", { type, touchPoints });
    await touch("touchStart", at(0));
    for (let part = 1; part <= parts; part++) await touch("touchMove", at(part));
    await touch("touchEnd", []);
  }
}

/** What is done by keys alone. */
export class Keys {
  constructor({ page }) {
    this.page = page;
  }

  /** Goes to an element by Tab, or back to it: as often as there seem to be elements between, and then on. */
  async to(selector) {
    const { keyboard } = this.page;
    for (let tries = 0; tries < 30; tries++) {
      const { isThere, isBehind, between } = await this.page.evaluate((wanted) => {
        const [active, target] = [document.activeElement, document.querySelector(wanted)];
        const follows = (a, b) => (a.compareDocumentPosition(b) & Node.DOCUMENT_POSITION_FOLLOWING) !== 0;
        const stops = [...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex]")].filter((one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility({ visibilityProperty: true }));
        const isBehind = target !== null && follows(target, active) && active !== document.body;
        const [from, to] = isBehind ? [target, active] : [active, target];
        return { isThere: active === target, isBehind, between: to === null ? 0 : stops.filter((stop) => follows(from, stop) && follows(stop, to)).length };
      }, selector);
      if (isThere) return;
      if (isBehind) await keyboard.down("Shift");
      // All of them at once: a page that draws is slow to say that it has heard of each.
      await Promise.all(Array.from({ length: between + 1 }, () => keyboard.press("Tab")));
      if (isBehind) await keyboard.up("Shift");
    }
    throw new Failure(`Tab does not reach ${selector}`);
  }

  async press(selector) {
    await this.to(selector);
    await this.page.keyboard.press(await this.page.locator(selector).getAttribute("type") === "checkbox" ? "Space" : "Enter");
  }

  /** Writes into a field, in place of what stands there. */
  async write(selector, text) {
    await this.to(selector);
    await this.page.keyboard.press("Control+a");
    await this.page.keyboard.type(String(text));
  }
}

/** Keeps count of the pointers and keys that a page is told of, from when it is opened: `meansUsed` reads it. */
export function countMeans({ page }) {
  return page.addInitScript(() => {
    window.means = {};
    const count = ({ pointerType, isTrusted }) => { if (isTrusted) window.means[pointerType ?? "key"] = (window.means[pointerType ?? "key"] ?? 0) + 1; };
    for (const type of ["pointerdown", "keydown"]) window.addEventListener(type, count, true);
  });
}
export const meansUsed = ({ page }) => page.evaluate(() => Object.keys(window.means).sort().join(", "));

/** Runs steps; ends the process's exit code with 1 where one fails. */
export async function run(steps, viewers, close) {
  for (const [name, step] of steps) {
    const start = Date.now();
    try {
      await step();
      console.log(`ok      ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
    } catch (error) {
      process.exitCode = 1;
      for (const viewer of viewers()) await viewer.picture("failed").catch(() => {});
      console.error(`FAILED  ${name}: ${error instanceof Failure ? error.message : error.stack}`);
      const complaints = viewers().flatMap((viewer) => viewer.complaints);
      if (complaints.length) console.error(complaints.join("\n"));
      break;
    }
  }
  await close();
  console.log(`Screenshots are in ${screenshots}`);
}
