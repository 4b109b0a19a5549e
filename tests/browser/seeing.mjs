/**
 * Looks at a running nozzle as a person would, in Debian's Chromium: on a narrow page and a wide one, in light and dark; moves the
 * camera, a slice and the range of the colours, reads and pins a place, reloads, and turns a picture of very many triangles. Then it has
 * the page in troubles.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/seeing.mjs
 *
 * The variables are those of page.mjs.
 */
import { readFileSync } from "node:fs";
import { Viewer, check, launch, link, run } from "./page.mjs";
import { troubles } from "./troubles.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "seeing", { colorScheme: "dark" });
const { page } = viewer;
/** The parameters as the run has told them last. */
const told = {};
page.on("websocket", (socket) => socket.on("framereceived", ({ payload }) => {
  if (typeof payload === "string" && payload.includes('"parameters"')) Object.assign(told, JSON.parse(payload).parameters?.values);
}));

/** How many triangles each picture was drawn with, the newest last; and when the first was drawn. */
await page.addInitScript(() => {
  window.pictures = [];
  window.firstPicture = Infinity;
  let triangles = null;
  const count = (mode, corners) => {
    if (mode !== WebGL2RenderingContext.TRIANGLES) return;
    if (triangles === null) queueMicrotask(() => {
      window.pictures = [...window.pictures.slice(-50), triangles];
      if (triangles > 0) window.firstPicture = Math.min(window.firstPicture, performance.now());
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

/** What the page may do, and nothing else: no script of others, none in the page itself, no other host, no frame around it. */
const POLICY = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self'; "
  + "connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const until = (what, condition, argument) => viewer.holds(what, condition, argument);
const drawn = () => viewer.drawn();
const picture = (name) => viewer.picture(name);
const YELLOW = [253, 231, 37];
/** The numbers at the ends of the bar. */
const ends = () => Promise.all(["lowest", "highest"].map(async (end) => Number((await page.inputValue(`.scalar-bar input[aria-label$="${end} value"]`)).replace("−", "-"))));
const bounds = () => page.evaluate(() => window.tombolo.views.midplane.bounds);

const steps = [
  ["the first picture comes with little on the wire", async () => {
    const answer = await page.goto(link);
    await until("a first picture", () => window.tombolo?.frames > 0);
    await drawn();
    // The reference surface and the schemas are not waited for: whether they come before it is a matter of how fast the page is.
    const wire = await page.evaluate(() => performance.getEntries()
      .filter(({ name, startTime, transferSize }) => transferSize > 0 && startTime < window.firstPicture && !/\/(surface|schema|schema\/order)$/.test(new URL(name, location.href).pathname))
      .reduce((sum, { transferSize }) => sum + transferSize, 0));
    check(wire > 0 && wire < 700_000, `${wire} bytes came before the first picture`);
    await picture("wide");
    const policy = answer.headers()["content-security-policy"];
    check(policy === POLICY, `the policy of the page is "${policy}"`);
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
  ["component, colours, opacity and edges change the picture, and about 0 the range", async () => {
    // A run that rests draws nothing new by itself.
    await page.click("#pause");
    await until("the rest", () => document.getElementById("run").textContent === "paused");
    await page.mouse.move(5, 5);
    // The frames that were on their way are here once every view that is shown has that of its last turn.
    const frames = () => until("the last frames", () => {
      const { pipelines, status, views, frames: count } = window.tombolo;
      const isLast = ([name, { cycle }]) => cycle === null || status.cycle - cycle < (pipelines.find((pipeline) => pipeline.name === name)?.every?.steps ?? Infinity);
      return status.paused && Object.entries(views).every(isLast) && count;
    });
    let still = null;
    await viewer.until("a picture that rests", async () => {
      const [before, count] = [still, await frames()];
      still = await drawn();
      return before?.pixels === still.pixels && count === await frames();
    });
    const look = (label) => page.locator("#look").getByLabel(label, { exact: true });
    const opacity = page.getByLabel("midplane: opacity");
    check((await viewer.text(".scalar-bar .title small")) === "m/s" && (await viewer.text("#look .unit")) === "m/s", "the velocity has no unit");
    const [low, high] = await ends();
    const changes = {
      component: [() => look("component").selectOption("1"), () => look("component").selectOption("-1")],
      "a colour map": [() => look("colours").selectOption({ label: "Inferno" }), () => look("colours").selectOption("viridis")],
      edges: [() => look("edges").selectOption("mesh"), () => look("edges").selectOption("features")],
      opacity: [() => opacity.fill("0"), () => opacity.fill("100")],
      "about 0": [() => look("about 0").check(), () => look("about 0").uncheck()],
    };
    for (const [what, [change, back]] of Object.entries(changes)) {
      await change();
      check((await drawn()).pixels !== still.pixels, `${what} changes nothing in the picture`);
      if (what === "opacity") check((await viewer.pixelsOf(YELLOW)) === 0, "a view without opacity is seen");
      if (what === "component") check(/velocity y$/.test(await page.getAttribute(".scalar-bar", "aria-label")), "the bar does not name the component");
      if (what === "about 0") {
        const about = await ends();
        check(about[0] === -about[1] && about[1] >= Math.max(-low, high), `about 0 the range is ${about}, before it was ${[low, high]}`);
      }
      await back();
      await viewer.until(`the picture as it was before ${what}`, async () => (await drawn()).pixels === still.pixels);
    }
    check((await viewer.pixelsOf(YELLOW)) > 0, "the fastest flow is not yellow");
    await page.click("#pause");
    await until("the run again", () => document.getElementById("run").textContent === "running");
  }],
  ["two clicks measure a distance", async () => {
    await page.click("#ruler");
    const places = [];
    for (const feature of ["upstream", "downstream"]) {
      await page.mouse.move(...(await viewer.place(feature)));
      const tip = await until("the place under the pointer", (name) => { const text = document.getElementById("tip").innerText; return text.startsWith(name) && /\(.*\)/.test(text) && text; }, feature);
      places.push(tip.match(/\(([^)]*)\)/)[1].split(", ").map((part) => Number(part.replace("−", "-"))));
      await page.mouse.click(...(await viewer.place(feature)));
    }
    const told = await until("the distance", () => document.querySelector("#marks text.ruler")?.textContent);
    const [from, to] = places;
    const distance = Math.hypot(...from.map((part, k) => to[k] - part));
    check(Math.abs(Number(told.split(" ")[0]) / distance - 1) < 0.02, `the ruler says ${told}, the places are ${JSON.stringify(places)}`);
    const whole = (await page.evaluate(() => ["upstream", "downstream"].map((name) => window.tombolo.featureBounds(name)))).map(([low, high]) => [low[1], high[1]]);
    places.forEach(([, y], i) => check(y >= whole[i][0] - 1e-3 && y <= whole[i][1] + 1e-3, `a place at y = ${y} lies outside of ${whole[i]}`));
    await page.click("#ruler");
    await until("no ruler", () => document.querySelector("#marks .ruler") === null);
  }],
  ["the mesh is coloured by its quality", async () => {
    await page.getByRole("button", { name: "Colour by mesh quality" }).click();
    await until("the bar of the quality", () => document.querySelector(".scalar-bar .title")?.textContent === "mesh quality");
    const [low, high] = await ends();
    check(low > 0 && low < high && high <= 1, `the quality goes from ${low} to ${high}`);
    await page.locator("#look select").first().selectOption("velocity");
    await until("the bar of the velocity", () => /^velocity magnitude/.test(document.querySelector(".scalar-bar .title")?.textContent ?? ""));
  }],
  ["the picture is saved, and fills the screen", async () => {
    const waiting = page.waitForEvent("download");
    await page.click("#screenshot");
    const file = await waiting;
    check(/\.png$/.test(file.suggestedFilename()), `the picture is called ${file.suggestedFilename()}`);
    const png = readFileSync(await file.path());
    const size = [png.readUInt32BE(16), png.readUInt32BE(20)];
    const shown = await page.evaluate(() => { const { clientWidth, clientHeight } = document.getElementById("scene"); return [clientWidth, clientHeight].map((side) => Math.round(side * devicePixelRatio)); });
    check(png.subarray(1, 4).toString() === "PNG" && size.every((side, k) => Math.abs(side - shown[k]) <= 1), `the file is ${size}, the picture ${shown}`);
    check(png.length > 10_000, `the file has ${png.length} bytes`);
    await page.click("#full-screen");
    await until("the full screen", () => document.fullscreenElement !== null && document.fullscreenElement.contains(document.getElementById("scene")));
    await page.locator("#scene").press("f");
    await until("the page again", () => document.fullscreenElement === null);
  }],
  ["a parameter beyond its bounds is refused beside it, and a slider sets one", async () => {
    const field = page.locator("#parameters .field", { hasText: "inlet velocity" });
    check(/m\/s/.test(await field.locator("label").innerText()), `the parameter has no unit: "${await field.locator("label").innerText()}"`);
    await field.locator("input").first().fill("99");
    await page.keyboard.press("Enter");
    const said = await until("the error beside it", () => [...document.querySelectorAll("#parameters .wrong")].find((wrong) => !wrong.hidden)?.textContent);
    check(/inlet velocity/.test(said) && /40/.test(said), `it says "${said}"`);
    await viewer.clean("with a parameter's error");
    await field.locator('input[type="range"]').fill("60");
    await viewer.until("the value in the run", () => told.inlet_velocity === 12);
    check((await field.locator("input").first().inputValue()) === "12" && (await field.locator(".wrong").isHidden()), "the error stays, or another value is shown");
    // So that what comes next is as it was.
    await field.locator("input").first().fill("10");
    await page.keyboard.press("Enter");
    await viewer.until("the first value in the run", () => told.inlet_velocity === 10);
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
    await page.click('[data-camera="parallel"]');
    await page.locator("#scene").press("Shift+ArrowLeft");
    await page.check('input[aria-label="throat: handle"]');
    await viewer.field("factors z").fill("0.9");
    await until("a preview", () => window.tombolo.preview.state === "shown");
    const stood = () => page.evaluate(() => JSON.stringify([window.tombolo.camera, window.tombolo.selection]));
    const before = await stood();
    await page.reload();
    await until("a picture again", () => window.tombolo?.frames > 0);
    check((await page.locator('[data-camera="parallel"]').getAttribute("aria-pressed")) === "true", "the button of the projection forgot it");
    await until("what stood in the form", () => window.tombolo.preview.state === "shown");
    check((await viewer.field("factors z").inputValue()) === "0.9", `the form holds ${await viewer.field("factors z").inputValue()}`);
    check((await stood()) === before, `camera and handle are ${await stood()}, and were ${before}`);
    await page.click("#cancel");
    await page.click('[data-camera="parallel"]');
    await page.click('[data-camera="reset"]');
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
    const small = await viewer.small();
    check(small.length === 0, `smaller than 24 px: ${small.join(", ")}`);
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
    await viewer.clean("with the drawer of the shape");
    const drawer = await viewer.small();
    check(drawer.length === 0, `in the drawer these are smaller than 24 px: ${drawer.join(", ")}`);
    await page.click("#right-drawer");
    await page.click("#keys-button");
    check(await page.isVisible("#keys"), "the sheet of keys does not open");
    await viewer.clean("with the sheet of keys");
    const sheet = await viewer.small();
    check(sheet.length === 0, `with the sheet of keys these are smaller than 24 px: ${sheet.join(", ")}`);
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
  ...troubles(browser, viewer),
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

await run(steps, () => [viewer], () => browser.close());
