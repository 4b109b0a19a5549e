/**
 * One of the paper's three demonstrations in Debian's Chromium, each by another means: the throat of the nozzle is pinched by the keyboard
 * alone, the outlet of the bypass is made less steep by the mouse, the pipe is widened by touch. Each is previewed, forecast, applied,
 * measured and taken back; then the run is stopped.
 *
 *     TOMBOLO_DEMONSTRATION=nozzle TOMBOLO_URL=http://127.0.0.1:7070/?token=... TOMBOLO_PID=... node tests/browser/paper.mjs
 *
 * TOMBOLO_DEMONSTRATION is nozzle, bypass or pipe. TOMBOLO_SHOWN is a file for what the page shows in the end, as JSON. The other variables
 * are those of page.mjs.
 */
import { writeFileSync } from "node:fs";
import { Failure, Fingers, Keys, Viewer, check, countMeans, launch, link, meansUsed, run } from "./page.mjs";

const NAME = process.env.TOMBOLO_DEMONSTRATION;
const browser = await launch();
const viewer = await Viewer.open(browser, NAME, NAME === "pipe" ? { viewport: { width: 820, height: 1180 }, hasTouch: true } : {});
await countMeans(viewer);
const { page } = viewer;
const keys = new Keys(viewer);
const fingers = new Fingers(viewer);
const bounds = (feature) => page.evaluate((name) => window.tombolo.featureBounds(name), feature);
const apart = (a, b) => Math.max(...a.flat().map((value, i) => Math.abs(value - b.flat()[i])));
const known = async () => new Set((await viewer.look()).orders.map((order) => order.id));
/** What was measured before the shape was changed, and what the page has said. */
const before = {}, forecasts = {};

/** Waits for the preview and the forecast of what stands in the form. */
async function foretold() {
  const { preview } = await viewer.until("the preview", ({ preview: now }) => {
    check(now.state !== "failed", `there is no preview: ${now.reason}`);
    return now.state === "shown";
  });
  const { forecast } = await viewer.until("the forecast", ({ forecast: now }) => {
    check(now.state !== "failed", `there is no forecast: ${now.reason}`);
    return now.state === "told";
  });
  check(forecast.outcome === "applied" && forecast.inverted === 0, `the forecast is ${JSON.stringify(forecast)}`);
  const text = await page.locator("#forecast").textContent();
  check(/^Forecast: least quality 0\.\d+/.test(text), `the page says "${text}"`);
  await viewer.picture("foretold");
  return { preview, text };
}

/** Gives an order by `act`, and waits until it is applied: as it was previewed. */
async function applied(act, told = null) {
  const others = await known();
  await act();
  const order = await viewer.settled(others);
  check(order.status === "applied", `it was refused: ${order.reason}`);
  if (told) {
    forecasts[order.id] = told.text;
    check(Math.abs(order.largest_displacement - told.preview.largest) <= 1e-9 * told.preview.largest, `the preview moved by up to ${told.preview.largest}, the order by ${order.largest_displacement}`);
  }
  return order;
}

/** Keeps where features are. */
async function measure(...features) {
  for (const feature of features) before[feature] = await bounds(feature);
}

const sizes = (box) => box[0].map((low, axis) => box[1][axis] - low);
/** Waits until the extents of a feature are those that it had, times these factors. */
async function scaled(feature, factors) {
  const expected = sizes(before[feature]).map((size, axis) => size * factors[axis]);
  await viewer.until(`the extents ${expected} of ${feature}`, async () => apart([sizes(await bounds(feature))], [expected]) < 1e-4 * Math.max(...expected));
}
/** Waits until features are where they were. */
async function asTheyWere(...features) {
  for (const feature of features) await viewer.until(`${feature} where it was`, async () => apart(await bounds(feature), before[feature]) < 1e-4 * Math.max(...sizes(before[feature])));
}

const nozzle = [
  ["the throat is made half as high by keys", async () => {
    await measure("throat", "inlet", "outlet");
    // To the foot of the page, and back from there.
    await keys.to("#to-apply");
    await keys.press("Enter");
    await keys.to('input[aria-label="throat: handle"]', "Shift+Tab");
    await keys.press("Space");
    await keys.to("#action", "Shift+Tab");
    for (let options = 0; options < 20 && (await page.inputValue("#action")) !== "scale_direction"; options++) await keys.press("ArrowDown");
    check((await page.inputValue("#action")) === "scale_direction", "the arrow keys do not reach the action");
    await keys.to('.object:not([hidden]) input[aria-label="factors z"]');
    await keys.write(0.5);
    const told = await foretold();
    await keys.to("#apply");
    await applied(() => keys.press("Enter"), told);
    await scaled("throat", [1, 1, 0.5]);
    await asTheyWere("inlet", "outlet");
    await viewer.picture("applied");
  }],
  ["it is taken back by keys", async () => {
    await applied(() => keys.press("Control+z"));
    await asTheyWere("throat", "inlet", "outlet");
  }],
  ["nothing but keys was used", async () => check((await meansUsed(viewer)) === "key", `used: ${await meansUsed(viewer)}`)],
];

/** The nodes of the skeleton that can be dragged: what they are called, and where they are seen. */
async function nodes() {
  await viewer.drawn();
  const places = await page.evaluate(() => window.tombolo.skeleton?.places ?? []);
  const names = await page.getByLabel("bend at").locator("option").allInnerTexts();
  return places.map((place, i) => ({ name: names[i + names.length - places.length], place }));
}

/** The degrees between the artery and the bypass where it comes back to it: from its last node to the node of the artery beside it. */
async function outletAngle() {
  const all = await nodes();
  const last = all.filter(({ name }) => name.startsWith("bypass")).sort((a, b) => b.place[0] - a.place[0])[0];
  const behind = all.filter(({ name, place }) => name.startsWith("artery") && place[0] > last.place[0]).sort((a, b) => a.place[0] - b.place[0])[0];
  return { last, degrees: (Math.atan2(behind.place[1] - last.place[1], behind.place[0] - last.place[0]) * 180) / Math.PI };
}

const bypass = [
  ["the outlet of the bypass is made less steep by the mouse", async () => {
    await measure("artery", "inlet", "outlet", "bypass");
    await page.click('input[aria-label="artery: fixed"]');
    await page.click('[data-camera="2"]');
    await page.click("#skeleton");
    await viewer.holds("the skeleton", () => window.tombolo.skeleton?.places.length > 0);
    before.angle = await outletAngle();
    const [x, y] = before.angle.last.place;
    // Seen along z: against the stream and down to the artery.
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x - 6, y + 11, { steps: 6 });
    await page.mouse.up();
    const by = await Promise.all(["x", "y", "z"].map((axis) => page.inputValue(`.object:not([hidden]) .entry input[aria-label$=" by ${axis}"]`).then(Number)));
    check(by[0] < 0 && by[1] < 0 && Math.abs(by[0] / by[1] - 6 / 11) < 0.05 && by[2] === 0, `the drag is ${by}`);
    const told = await foretold();
    await applied(() => page.click("#apply"), told);
    await asTheyWere("artery", "inlet", "outlet");
    const angle = await viewer.until("the node where it was dragged", async () => Math.hypot(...(await outletAngle()).last.place.map((value, k) => value - [x - 6, y + 11][k])) < 1).then(outletAngle);
    const fall = before.angle.degrees - angle.degrees;
    console.log(`    dragged by ${by}: from ${before.angle.degrees.toFixed(1)} to ${angle.degrees.toFixed(1)} degrees`);
    check(fall > 5 && fall < 20, `from ${before.angle.degrees} to ${angle.degrees} degrees`);
    await viewer.picture("applied");
  }],
  ["it is taken back by the mouse", async () => {
    await applied(() => page.click("#undo"));
    await asTheyWere("artery", "inlet", "outlet", "bypass");
    await viewer.until("the angle as it was", async () => Math.abs((await outletAngle()).degrees - before.angle.degrees) < 0.1);
  }],
  ["nothing but the mouse was used", async () => check((await meansUsed(viewer)) === "mouse", `used: ${await meansUsed(viewer)}`)],
];

/** What makes a section of a pipe larger by a tenth. */
const WIDER = 1.0488088481701516;
const pipe = [
  ["the pipe is widened by a finger", async () => {
    await measure("wall", "outlet", "inlet");
    // Seen along x, its axis lies across the picture or up it, and no box that is dragged points at the one who looks.
    await fingers.tap('[data-camera="0"]');
    await viewer.drawn();
    const place = await viewer.place("wall");
    check(place, "the wall cannot be seen");
    await fingers.tap(place);
    await viewer.until("the wall as the handle", (now) => now.selection.handle.join() === "wall");
    await fingers.tap("#right-drawer");
    await fingers.tap('input[aria-label="outlet: handle"]');
    await fingers.tap("#right-drawer");
    await viewer.drawn();
    const box = await page.evaluate(() => window.tombolo.gizmo["box y"]);
    check(box, "the gizmo has no box y");
    await fingers.drag(box, [14, 0]);
    await fingers.tap("#right-drawer");
    const dragged = Number(await viewer.field("factors y").inputValue());
    check(dragged > 0 && dragged !== 1, `the finger scales by ${dragged}`);
    await viewer.picture("dragged");
    for (const axis of ["x", "y"]) await fingers.write(`.object:not([hidden]) input[aria-label="factors ${axis}"]`, WIDER);
    const told = await foretold();
    await applied(() => fingers.tap("#apply"), told);
    for (const feature of ["wall", "outlet"]) await scaled(feature, [WIDER, WIDER, 1]);
    await asTheyWere("inlet");
    await fingers.tap("#right-drawer");
    await viewer.picture("applied");
  }],
  ["it is taken back by a finger", async () => {
    await fingers.tap("#right-drawer");
    await applied(() => fingers.tap("#undo"));
    await asTheyWere("wall", "outlet", "inlet");
  }],
  ["nothing but touch was used", async () => check((await meansUsed(viewer)) === "touch", `used: ${await meansUsed(viewer)}`)],
];

const demonstration = { nozzle, bypass, pipe }[NAME];
if (!demonstration) throw new Failure(`TOMBOLO_DEMONSTRATION is ${NAME}: it must be nozzle, bypass or pipe`);

const steps = [
  ["a first picture", async () => {
    await page.goto(link);
    await viewer.until("a first picture", (now) => now.connection === "connected" && now.role === "driver" && now.frames > 0 && now.selection.fixed.length > 0);
    await viewer.drawn();
  }],
  ...demonstration,
  ["what the page shows of the run that has ended is kept", async () => {
    if (!process.env.TOMBOLO_SHOWN) return;
    process.kill(Number(process.env.TOMBOLO_PID), "SIGTERM");
    const { orders } = await viewer.until("the end", (now) => now.end !== null);
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.click("#history > summary");
    // The newest stands first.
    const details = (await page.locator("#orders .detail").allInnerTexts()).reverse();
    const rows = (selector) => page.locator(selector).evaluateAll((all) => all.map((row) => [...row.children].map((cell) => cell.innerText)));
    // The plots are drawn a moment after the numbers have come.
    await viewer.until("the newest pressure drop beside the plot", async () => Object.fromEntries(await rows("#dock tbody tr"))["Pressure drop [Pa]"] === Object.fromEntries(await rows("#monitors .monitor"))["Pressure drop"]?.replace(/\u00a0.*/, ""));
    const shown = {
      banner: await viewer.text("#banner-text"), cycle: await viewer.text("#cycle"), time: await viewer.text("#time"), quality: await viewer.text("#quality"),
      orders: orders.map(({ id }, i) => ({ id, detail: details[i], forecast: forecasts[id] ?? null })),
      monitors: Object.fromEntries(await rows("#monitors .monitor")),
      dock: Object.fromEntries(await rows("#dock tbody tr")),
    };
    writeFileSync(process.env.TOMBOLO_SHOWN, JSON.stringify(shown, null, 1));
  }],
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

await run(steps, () => [viewer], () => browser.close());
