/**
 * One of the paper's three demonstrations in Debian's Chromium, each by another means: the throat of the nozzle is pinched by the keyboard
 * alone, the outlet of the bypass is made less steep by the mouse, the pipe is widened by touch. Each is previewed, forecast, applied,
 * measured and taken back. By keyboard and touch an earlier edit is changed, a refusal met by its remedies, the wheel handed over, a pipeline
 * added. Then the run is stopped.
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
const options = NAME === "pipe" ? { viewport: { width: 820, height: 1180 }, hasTouch: true } : {};
const viewer = await Viewer.open(browser, NAME, options);
let colleague = null;
await countMeans(viewer);
const { page } = viewer;
const bounds = (feature) => page.evaluate((name) => window.tombolo.featureBounds(name), feature);
const apart = (a, b) => Math.max(...a.flat().map((value, i) => Math.abs(value - b.flat()[i])));
const known = async () => new Set((await viewer.look()).orders.map((order) => order.id));
/** What was measured before the shape was changed, and what the page has said. */
const before = {}, forecasts = {};

/** Waits for the forecast of what stands in the form. */
async function answered() {
  const { forecast } = await viewer.until("the forecast", ({ forecast: now }) => {
    check(now.state !== "failed", `there is no forecast: ${now.reason}`);
    return now.state === "told";
  });
  return forecast;
}

/** Waits for the preview and the forecast of what stands in the form, which is to pass. */
async function foretold() {
  const { preview } = await viewer.until("the preview", ({ preview: now }) => {
    check(now.state !== "failed", `there is no preview: ${now.reason}`);
    return now.state === "shown";
  });
  const forecast = await answered();
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

/** How far what is drawn may be from what is: a coordinate comes with an error of up to 1e-5 of the diagonal of its view, an extent has two. */
async function precision() {
  const { views } = await viewer.look();
  return 5e-5 * Math.max(...Object.values(views).map(({ bounds: [low, high] }) => Math.hypot(...low.map((value, axis) => high[axis] - value))));
}
const sizes = (box) => box[0].map((low, axis) => box[1][axis] - low);
/** Waits until the extents of a feature are those that it had, times these factors. */
async function scaled(feature, factors) {
  const expected = sizes(before[feature]).map((size, axis) => size * factors[axis]);
  const close = await precision();
  await viewer.until(`the extents ${expected} of ${feature}`, async () => apart([sizes(await bounds(feature))], [expected]) < close);
}
/** Waits until features are where they were. */
async function asTheyWere(...features) {
  const close = await precision();
  for (const feature of features) await viewer.until(`${feature} where it was`, async () => apart(await bounds(feature), before[feature]) < close);
}

/** A number of the edit that is in the form. */
const number = (label) => `.object:not([hidden]) input[aria-label="${label}"]`;

/**
 * What else is done by the same means as the demonstration, which has been taken back: an edit that is not the last is changed, one that
 * would be refused meets each of its remedies, the wheel goes to a colleague and comes back, a view is added from a template. `hand` is what
 * is made of a viewer: its keys, its fingers.
 */
const more = (hand, { feature, axis, second, changed, expected }) => [
  ["the first of two edits is changed by the same means", async () => {
    await applied(() => hand.press("#redo"));
    await hand.write(number(`factors ${axis}`), second);
    await applied(() => hand.press("#apply"), await foretold());
    await viewer.until("two edits", (now) => now.stack.length === 2);
    await hand.press('#stack [data-edit="0"] [data-act="load"]');
    await hand.write(number(`factors ${axis}`), changed);
    const told = await foretold();
    check((await viewer.text("#apply")) === "Update edit 1", `the button says "${await viewer.text("#apply")}"`);
    await applied(() => hand.press("#apply"));
    check(/least quality/.test(told.text), `the page says "${told.text}"`);
    await scaled(feature, expected);
    check((await viewer.look()).stack.length === 2, "the second edit is gone");
    await viewer.picture("first-edit");
  }],
  ["a refusal is met by each of its remedies by the same means", async () => {
    const refused = async () => {
      await hand.write(number(`factors ${axis}`), 0.01);
      const forecast = await answered();
      check(forecast.outcome === "rejected" && forecast.fraction > 0, `the forecast is ${JSON.stringify(forecast)}`);
      check(await page.locator("#apply").isDisabled(), "Apply can be pressed though it would be refused");
      return forecast;
    };
    const { fraction } = await refused();
    await viewer.picture("refused");
    const { pixels } = await viewer.drawn();
    await hand.press("#show-worst");
    check((await viewer.drawn()).pixels !== pixels, "the camera did not go to the worst cell");
    await viewer.picture("worst-cell");
    await hand.press('[data-camera="reset"]');
    const offered = await page.locator("#apply-part").textContent();
    check(/^Apply \d+(\.\d+)? %$/.test(offered), `the first button says "${offered}"`);
    await hand.press("#apply-part");
    const filled = Number(await page.locator(number(`factors ${axis}`)).inputValue());
    check(Math.abs(1 - filled - 0.99 * fraction) < 0.002, `${offered} fills in ${filled}, ${fraction} would pass`);
    // The fraction is that of the straight way to a mesh that was improved: of the part itself less may pass, which is offered then.
    let told = await answered();
    for (let parts = 1; told.outcome === "rejected" && parts < 3; parts++) {
      await hand.press("#apply-part");
      told = await answered();
    }
    check(told.outcome === "applied" && told.inverted === 0, `the forecast of a part is ${JSON.stringify(told)}`);
    check(await page.locator("#apply").isEnabled(), "Apply cannot be pressed though it would pass");
    const again = await refused();
    check((await page.getAttribute("#untangle", "hidden")) === null, `Untangle is not offered: ${JSON.stringify(again)}`);
    await hand.press("#untangle");
    const untangled = await answered();
    check((await page.getAttribute("#untangle", "hidden")) !== null, "Untangle is offered again");
    console.log(`    refused at 0.01: ${offered}; untangled it is ${untangled.outcome}`);
    await hand.press("#cancel");
    check((await page.locator(number(`factors ${axis}`)).inputValue()) === "1" && (await viewer.look()).stack.length === 2, "what was refused is left behind");
  }],
  ["the wheel is handed over and comes back by the same means", async () => {
    colleague = await Viewer.open(browser, "colleague", options);
    await countMeans(colleague);
    await colleague.page.goto(link);
    await colleague.until("watching", (now) => now.role === "watcher" && now.frames > 0);
    const other = new hand.constructor(colleague);
    for (const [asks, asksBy, gives, givesBy] of [[colleague, other, viewer, hand], [viewer, hand, colleague, other]]) {
      await asksBy.press("#wheel");
      await gives.holds("the question", () => !document.getElementById("asked").hidden);
      await givesBy.press("#hand-over");
      await asks.until("the wheel", (now) => now.role === "driver");
      await gives.until("watching", (now) => now.role === "watcher");
    }
    check((await meansUsed(colleague)) === (await meansUsed(viewer)), `the colleague used ${await meansUsed(colleague)}`);
    await colleague.page.context().close();
  }],
  ["a view is added from a template by the same means", async () => {
    await hand.press("#pipeline-add");
    await hand.press('[data-template="slice"]');
    await viewer.holds("a text without errors", () => document.getElementById("pipeline-state").textContent === "No errors.");
    await hand.press("#pipeline-apply");
    await viewer.until("the slice", (now) => now.views.slice?.triangles > 0);
    check((await page.evaluate(() => window.tombolo.pipelines)).some(({ name }) => name === "slice"), "the run has no pipeline of this name");
    await viewer.picture("slice");
  }],
];

const keys = new Keys(viewer);
const nozzle = [
  ["the throat is made half as high by keys", async () => {
    await measure("throat", "inlet", "outlet");
    // To the foot of the page, and back from there.
    await keys.press("#to-apply");
    await keys.press('input[aria-label="throat: handle"]');
    await keys.to("#action");
    for (let options = 0; options < 20 && (await page.inputValue("#action")) !== "scale_direction"; options++) await page.keyboard.press("ArrowDown");
    check((await page.inputValue("#action")) === "scale_direction", "the arrow keys do not reach the action");
    await keys.write(number("factors z"), 0.5);
    const told = await foretold();
    await applied(() => keys.press("#apply"), told);
    await scaled("throat", [1, 1, 0.5]);
    await asTheyWere("inlet", "outlet");
    await viewer.picture("applied");
  }],
  ["it is taken back by keys", async () => {
    await applied(() => page.keyboard.press("Control+z"));
    await asTheyWere("throat", "inlet", "outlet");
  }],
  ...more(keys, { feature: "throat", axis: "z", second: 0.9, changed: 0.8, expected: [1, 1, 0.72] }),
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
const fingers = NAME === "pipe" ? new Fingers(viewer) : null;
const pipe = [
  ["the pipe is widened by a finger", async () => {
    await measure("wall", "outlet", "inlet");
    // Seen along x, no box that is dragged here points at the one who looks.
    await fingers.press('[data-camera="0"]');
    await viewer.drawn();
    const place = await viewer.place("wall");
    check(place, "the wall cannot be seen");
    await page.touchscreen.tap(...place);
    await viewer.until("the wall as the handle", (now) => now.selection.handle.join() === "wall");
    await fingers.press('input[aria-label="outlet: handle"]');
    await fingers.drawer();
    await viewer.drawn();
    const box = await page.evaluate(() => window.tombolo.gizmo["box y"]);
    check(box, "the gizmo has no box y");
    await fingers.drag(box, [14, 0]);
    const dragged = Number(await viewer.field("factors y").inputValue());
    check(dragged > 0 && dragged !== 1, `the finger scales by ${dragged}`);
    await viewer.picture("dragged");
    for (const axis of ["x", "y"]) await fingers.write(number(`factors ${axis}`), WIDER);
    const told = await foretold();
    await applied(() => fingers.press("#apply"), told);
    for (const feature of ["wall", "outlet"]) await scaled(feature, [WIDER, WIDER, 1]);
    await asTheyWere("inlet");
    await viewer.picture("applied");
  }],
  ["it is taken back by a finger", async () => {
    await applied(() => fingers.press("#undo"));
    await asTheyWere("wall", "outlet", "inlet");
  }],
  ...more(fingers, { feature: "outlet", axis: "x", second: 0.95, changed: 1.02, expected: [1.02 * 0.95, WIDER, 1] }),
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
  ["nothing went wrong on the way", async () => {
    const complaints = [viewer, colleague].flatMap((one) => one?.complaints ?? []);
    check(complaints.length === 0, complaints.join("\n"));
  }],
];

await run(steps, () => [viewer], () => browser.close());
