/**
 * Drives the viewer of a running nozzle as a person would, in Debian's Chromium: sees the flow, pinches the throat through
 * the form, takes it back, pauses, loses the connection, and opens a link with a wrong token.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/demo.mjs
 *
 * TOMBOLO_SCHEDULE has the steps of the pinch and the cycles between them (default 10,1); the other variables are those of page.mjs.
 */
import { connect, createServer } from "node:net";
import { Failure, Viewer, check, launch, link, patience, run } from "./page.mjs";

const HANDLE = "throat", FIXED = ["inlet", "outlet"], FACTOR = 0.5;
const [scheduleSteps, scheduleEvery] = (process.env.TOMBOLO_SCHEDULE ?? "10,1").split(",");

/** Passes the bytes of the run on, so that the test can cut the connection without touching the run. */
async function cuttable(target) {
  const pairs = new Set();
  let down = false;
  const server = createServer((near) => {
    if (down) {
      near.destroy();
      return;
    }
    const far = connect(Number(target.port || 80), target.hostname);
    const pair = [near, far];
    pairs.add(pair);
    for (const [from, to] of [[near, far], [far, near]]) {
      from.pipe(to);
      from.on("error", () => {});
      from.on("close", () => {
        to.destroy();
        pairs.delete(pair);
      });
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const url = new URL(target);
  url.hostname = "127.0.0.1";
  url.port = String(server.address().port);
  return {
    url: url.toString(),
    cut: () => {
      down = true;
      pairs.forEach(([near]) => near.destroy());
    },
    mend: () => { down = false; },
    close: () => {
      pairs.forEach(([near]) => near.destroy());
      server.close();
    },
  };
}

const proxy = await cuttable(new URL(link));
const browser = await launch();
const viewer = await Viewer.open(browser, "demo");
const { page } = viewer;
/** What the page has sent beside forecasts and how far its decoder is, and how often it has asked for the reference surface. */
const traffic = { messages: 0, surfaces: 0, requests: 0 };
// Forecasts are questions: they change nothing.
page.on("websocket", (socket) => socket.on("framesent", ({ payload }) => { traffic.messages += typeof payload !== "string" || /"(forecast|here)"/.test(payload) ? 0 : 1; }));
page.on("request", (request) => {
  traffic.requests++;
  if (new URL(request.url()).pathname === "/surface") traffic.surfaces++;
  const { hostname } = new URL(request.url());
  if (hostname && hostname !== "127.0.0.1") viewer.complaints.push(`the page asked another host: ${request.url()}`);
});

const look = () => viewer.look();
const extent = () => viewer.extent(HANDLE, 2);
const until = (what, condition) => viewer.until(what, condition);
const drawn = () => viewer.drawn();
const picture = (name, shown) => viewer.picture(name, shown);

/** How many pixels of the column at `x` the shape covers, all that has come being drawn. */
async function silhouette(x) {
  await drawn();
  // Of the picture alone, without the tools, the gizmo and the edge of the slice over it and the help below.
  const box = await page.locator("#scene").boundingBox();
  const clip = { x: Math.round(x), y: Math.round(box.y) + 60, width: 1, height: Math.round(box.height) - 150 };
  const png = (await page.screenshot({ clip, style: ".gizmo, #cut, #tools { visibility: hidden }" })).toString("base64");
  return page.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = image.width;
    canvas.height = image.height;
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const { data: pixels } = context.getImageData(0, 0, image.width, image.height);
    let first = -1, last = -1;
    for (let row = 0; row < image.height; row++) {
      const differs = [0, 1, 2].some((k) => Math.abs(pixels[4 * row * image.width + k] - pixels[k]) > 5);
      if (differs && first < 0) first = row;
      if (differs) last = row;
    }
    return first < 0 ? 0 : last - first + 1;
  }, png);
}

/** Clicks a feature in the picture, turning the camera along the flow where it cannot be seen otherwise. */
async function pick(name, modifiers) {
  for (const camera of ["reset", "1", "1", "0", "2"]) {
    await page.click(`[data-camera="${camera}"]`);
    await drawn();
    const place = await page.evaluate((feature) => window.tombolo.featurePlace(feature), name);
    if (!place) continue;
    await page.mouse.move(place[0], place[1]);
    const shown = () => page.evaluate(() => { const tip = document.getElementById("tip"); return tip.hidden ? "" : tip.textContent; });
    await until(`the name of ${name} beside the pointer`, async () => (await shown()).startsWith(name));
    check((await shown()).startsWith(name), `hovering ${name} shows "${await shown()}"`);
    for (const key of modifiers) await page.keyboard.down(key);
    await page.mouse.click(place[0], place[1]);
    for (const key of modifiers) await page.keyboard.up(key);
    await page.mouse.move(place[0], place[1] > 400 ? 120 : 700);
    return;
  }
  throw new Failure(`the feature ${name} cannot be seen from any side`);
}

const steps = [
  ["the page connects, steers and draws", async () => {
    await page.goto(proxy.url);
    const seen = await until("a first picture", (now) => now.connection === "connected" && now.frames > 0);
    check(seen.role === "driver", `the first viewer should steer, it is ${seen.role}`);
    check(Object.values(seen.views).some((view) => view.triangles > 0), "no view has triangles");
    await drawn();
    await picture("flow");
  }],
  ["frames change", async () => {
    // Told by the page in the task that has drawn: a screenshot says nothing of which frames are in it.
    const first = await drawn();
    check(first.cycle !== null, "a picture without a frame in it");
    await until("another picture of newer frames", async () => {
      const now = await drawn();
      return now.cycle > first.cycle && now.pixels !== first.pixels;
    });
  }],
  ["features are picked in the picture", async () => {
    await pick(HANDLE, []);
    // What flows in and out is held at first; a click with shift lets it go, another holds it again.
    const atFirst = (await look()).selection.fixed;
    check(JSON.stringify(atFirst) === JSON.stringify(FIXED), `fixed at first are ${JSON.stringify(atFirst)}`);
    await pick(FIXED[0], ["Shift"]);
    check(!(await look()).selection.fixed.includes(FIXED[0]), "a click with shift does not let go of what was held");
    await pick(FIXED[0], ["Shift"]);
    const { selection } = await look();
    check(JSON.stringify(selection.handle) === JSON.stringify([HANDLE]), `the handle is ${JSON.stringify(selection.handle)}`);
    check(FIXED.every((name) => selection.fixed.includes(name)) && selection.fixed.length === FIXED.length, `fixed are ${JSON.stringify(selection.fixed)}`);
    check(await page.isChecked(`input[aria-label="${HANDLE}: handle"]`), "the list does not show the handle that was picked in the picture");
    await page.click('[data-camera="reset"]');
    await drawn();
    await picture("picked");
  }],
  ["a mistake in the form is answered in words", async () => {
    await page.selectOption("#action", "scale_direction");
    await page.fill('.object:not([hidden]) input[aria-label="factors z"]', "half");
    await page.click("#apply");
    const problem = await page.locator("#problem").innerText();
    check(/half/.test(problem) && /not a number/.test(problem), `the form says "${problem}"`);
    check((await look()).orders.every((order) => order.status !== "sent"), "an order was sent although the form was wrong");
  }],
  ["what is typed is seen before anything is sent", async () => {
    const factor = (axis, value) => page.fill(`.object:not([hidden]) input[aria-label="factors ${axis}"]`, String(value));
    const { messages } = traffic;
    for (const axis of ["x", "y"]) await factor(axis, 1);
    const times = [], computing = [];
    for (let z = 0.95; z > FACTOR - 0.01; z -= 0.05) {
      await factor("z", z.toFixed(2));
      const { preview } = await until(`the preview of ${z.toFixed(2)}`, ({ preview: now }) => {
        check(now.state !== "failed", `there is no preview: ${now.reason}`);
        return now.state === "shown";
      });
      times.push(preview.milliseconds);
      computing.push(preview.computing);
      shared.preview = preview;
    }
    check(traffic.messages === messages, `${traffic.messages - messages} messages were sent for previews`);
    check(traffic.surfaces === 1, `the reference surface was asked for ${traffic.surfaces} times`);
    const { forecast } = await until("the forecast", ({ forecast: now }) => {
      check(now.state !== "failed", `there is no forecast: ${now.reason}`);
      return now.state === "told";
    });
    check(forecast.outcome === "applied" && forecast.inverted === 0 && forecast.min > 0, `the forecast is ${JSON.stringify(forecast)}`);
    const foretold = await page.locator("#forecast").innerText();
    check(/least quality 0\.\d+.*0 inverted/.test(foretold), `the form says "${foretold}"`);
    console.log(`    ${foretold}`);
    const text = await page.locator("#preview").innerText();
    check(/moves the surface by up to/.test(text), `the form says "${text}"`);
    const late = (list) => list.slice(1).sort((a, b) => a - b).at(-1).toFixed(0);
    console.log(`    from a key to its picture: first ${times[0].toFixed(0)} ms, then ${late(times)} ms at most, ${late(computing)} ms of it in the kernel; moves by up to ${shared.preview.largest}`);
    await picture("preview");
    await page.click('[data-camera="0"]');
    await drawn();
    await picture("preview-side");
    // A drag goes on from what stands in the form: here from nothing.
    await page.click("#cancel");
    // The same by hand: the throat is dragged across the picture.
    const place = await page.evaluate((name) => window.tombolo.featurePlace(name), HANDLE);
    check(place, "the throat cannot be seen along x");
    const dragged = [];
    await page.keyboard.down("Control");
    await page.mouse.move(...place);
    await page.mouse.down();
    for (let step = 1; step <= 20; step++) {
      await page.mouse.move(place[0] + 3 * step, place[1] - step);
      const { preview } = await until("the preview of the drag", ({ preview: now }) => now.state === "shown");
      dragged.push(preview.milliseconds);
    }
    await page.mouse.up();
    await page.keyboard.up("Control");
    const by = await Promise.all(["x", "y", "z"].map((axis) => page.inputValue(`.object:not([hidden]) input[aria-label="by ${axis}"]`)));
    check(Number(by[0]) === 0 && Number(by[1]) !== 0 && Number(by[2]) > 0, `a drag to the right and up, seen along x, is a translation by ${by}`);
    const { preview: last } = await look();
    check(Math.abs(last.largest - Math.hypot(...by.map(Number))) < 1e-12, `the form says ${by}, the preview moves by up to ${last.largest}`);
    dragged.sort((a, b) => a - b);
    console.log(`    from a drag to its picture: median ${dragged[10].toFixed(0)} ms, 95th percentile ${dragged[18].toFixed(0)} ms`);
    check(traffic.messages === messages, "messages were sent while dragging");
    await picture("preview-dragged");
    await page.click("#cancel");
    check((await look()).preview.state === "none" && (await page.locator("#preview").isHidden()), "the preview is still there after Cancel");
    await page.selectOption("#action", "scale_direction");
    await page.click('[data-camera="reset"]');
  }],
  ["the pinch is applied and the throat narrows", async () => {
    await page.click('[data-camera="0"]');
    await drawn();
    const place = await page.evaluate((name) => window.tombolo.featurePlace(name), HANDLE);
    check(place, "the throat cannot be seen along x");
    shared.column = place[0];
    shared.extent = await extent();
    shared.pixels = await silhouette(shared.column);
    check(shared.pixels > 20, `the throat is only ${shared.pixels} pixels high`);
    const known = new Set((await look()).orders.map((order) => order.id));
    for (const [axis, factor] of [["x", 1], ["y", 1], ["z", FACTOR]]) await page.fill(`.object:not([hidden]) input[aria-label="factors ${axis}"]`, String(factor));
    await viewer.scheduled(scheduleSteps, scheduleEvery);
    await until("the preview of the order", (now) => now.preview.state === "shown");
    await viewer.filmed("half-as-high", "right");
    await page.click("#apply");
    check((await look()).preview.state === "none", "the preview is still there after Apply");
    const phases = new Set();
    const seen = await until("the order applied", (now) => {
      const order = now.orders.find((entry) => !known.has(entry.id));
      if (order) phases.add(order.status);
      check(order?.status !== "rejected", `the pinch was rejected: ${order?.reason}`);
      return order?.status === "applied";
    });
    const order = seen.orders.find((entry) => !known.has(entry.id));
    check(Number.isInteger(order.cycle_applied), "an applied order without the cycle at which it was");
    check(Math.abs(order.largest_displacement - shared.preview.largest) <= 1e-9 * shared.preview.largest,
      `the preview moved by up to ${shared.preview.largest}, the order by ${order.largest_displacement}`);
    check(order.min_scaled_jacobian > 0, `an applied order with quality ${order.min_scaled_jacobian}`);
    console.log(`    seen: ${[...phases].join(", ")}; cycle ${order.cycle_applied}, quality ${order.min_scaled_jacobian}`);
    await until("the throat at half its height", async () => Math.abs((await extent()) / shared.extent - FACTOR) < 0.005);
    check(seen.quality === null || !(seen.quality.inverted > 0), `${seen.quality?.inverted} elements are inverted`);
    // The picture comes a moment after the numbers.
    let pixels = 0;
    await until("the throat at half its height in the picture", async () => {
      pixels = await silhouette(shared.column);
      return Math.abs(pixels / shared.pixels - FACTOR) < 0.12;
    });
    console.log(`    throat: ${shared.extent} to ${await extent()}; on the screen ${shared.pixels} to ${pixels} pixels`);
    await viewer.holds("the pinch in the list of edits", () => document.querySelectorAll("#stack li").length === 1);
    await viewer.filmed("half-as-high-applied", "right");
    await picture("pinched-side");
    await page.click('[data-camera="reset"]');
    await drawn();
    await picture("pinched", "viewer.png");
  }],
  ["undo brings the old shape back", async () => {
    await page.click('[data-camera="0"]');
    const known = new Set((await look()).orders.map((order) => order.id));
    await page.click("#undo");
    await until("the undo applied", (now) => {
      const order = now.orders.find((entry) => !known.has(entry.id));
      check(order?.status !== "rejected", `the undo was rejected: ${order?.reason}`);
      return order?.status === "applied";
    });
    await until("the throat at its old height", async () => Math.abs((await extent()) / shared.extent - 1) < 0.001);
    await until("an empty stack", (now) => now.stack.length === 0);
    // The picture comes a moment after the numbers.
    await until("the throat at its old height in the picture", async () => Math.abs((await silhouette(shared.column)) - shared.pixels) <= 3);
    await picture("undone");
  }],
  ["the shape is bent by a node of its skeleton", async () => {
    await page.click("#skeleton");
    const shown = () => window.tombolo.skeleton?.places.length > 0 && window.tombolo.skeleton;
    const bones = await (await page.waitForFunction(shown, null, { timeout: patience })).jsonValue();
    check(bones.segments >= bones.nodes - 1 && bones.places.length >= 6 && bones.places.length % 6 === 0, `the skeleton has ${bones.nodes} nodes, ${bones.segments} segments and ${bones.places.length} nodes to drag`);
    await drawn();
    const { messages } = traffic;
    const place = await page.evaluate(() => window.tombolo.skeleton.places).then((places) => places[places.length >> 1]);
    await page.keyboard.down("Control");
    await page.mouse.move(...place);
    await page.mouse.down();
    for (let step = 1; step <= 5; step++) {
      await page.mouse.move(place[0], place[1] - 3 * step);
      await until("the preview of the bend", ({ preview: now }) => {
        check(now.state !== "failed", `there is no preview: ${now.reason}`);
        return now.state === "shown";
      });
    }
    await page.mouse.up();
    await page.keyboard.up("Control");
    check(traffic.messages === messages, "messages were sent while bending");
    const by = await Promise.all(["x", "y", "z"].map((axis) => page.inputValue(`.object:not([hidden]) .entry input[aria-label$=" by ${axis}"]`)));
    const { preview } = await look();
    const length = Math.hypot(...by.map(Number));
    check(length > 0 && preview.largest > 0.5 * length && preview.largest < 3 * length, `a node was dragged by ${by}, the surface moves by up to ${preview.largest}`);
    const { forecast } = await until("the forecast of the bend", ({ forecast: now }) => now.state === "told");
    check(forecast.inverted === 0 || forecast.reason, `the forecast is ${JSON.stringify(forecast)}`);
    await picture("bent");
    await page.click("#cancel");
    await page.click("#skeleton");
    check((await page.evaluate(() => window.tombolo.skeleton)) === null, "the skeleton is still there");
    await page.selectOption("#action", "scale_direction");
  }],
  ["pause holds the run, resume lets it go on", async () => {
    await page.click("#pause");
    await until("the run paused", (now) => now.status?.paused === true);
    await page.waitForTimeout(1000);
    const held = (await look()).status.cycle;
    await page.waitForTimeout(2000);
    check((await look()).status.cycle === held, "the cycle went on while the run was paused");
    check((await page.locator("#pause").innerText()) === "Resume", "the button does not offer to resume");
    await picture("paused");
    await page.click("#pause");
    await until("the run going on", (now) => now.status?.paused === false && now.status.cycle > held);
  }],
  ["the connection comes back by itself", async () => {
    const before = await look();
    proxy.cut();
    await until("the loss noticed", (now) => now.connection === "reconnecting" || now.connection === "connecting");
    await picture("reconnecting");
    proxy.mend();
    const back = await until("the connection back", (now) => now.connection === "connected" && now.frames > before.frames + 2 && now.cycle > before.cycle);
    check(back.orders.length >= before.orders.length, "orders were forgotten");
    check(back.errors.length === 0, `frames or messages could not be read: ${back.errors.join("; ")}`);
  }],
  ["a wrong token is refused in words", async () => {
    const wrong = new URL(proxy.url);
    wrong.searchParams.set("token", "0".repeat(32));
    const answer = await page.goto(wrong.toString());
    if (answer.status() === 401) {
      const words = await page.locator("body").innerText();
      check(/token/.test(words), `a link with a wrong token shows "${words}"`);
    }
    // A viewer whose cookie is no longer right: another run listens at the same address.
    wrong.search = "";
    await page.goto("about:blank");
    await page.context().clearCookies();
    await page.goto(wrong.toString());
    await until("the refusal shown", (now) => now.connection === "refused");
    const text = await page.locator("#banner").innerText();
    check(/link/.test(text), `the banner says "${text}"`);
    await picture("wrong-token");
  }],
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

const shared = {};
await run(steps, () => [viewer], async () => {
  await browser.close();
  proxy.close();
});
