/**
 * What an engineer does on a first day, from the page alone, on the bypass, in Debian's Chromium: takes the tour, bends the graft by
 * 20 degrees, finds where the mesh is worst, compares the pressure drop before and after, changes the first of two edits, hands the wheel
 * to a colleague, and takes it all back. Each task is a screenshot at three sizes, and axe looks at each state. The task that a bypass has
 * nothing for, a throat half as high, is in demo.mjs.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/tasks.mjs
 *
 * The variables are those of page.mjs.
 */
import { Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "tasks");
let colleague = null;
const { page } = viewer;
const known = async () => new Set((await viewer.look()).orders.map((order) => order.id));
const told = () => viewer.until("the forecast", ({ forecast }) => {
  check(forecast.state !== "failed", `there is no forecast: ${forecast.reason}`);
  return forecast.state === "told";
});

const filmed = (name, drawer) => viewer.filmed(name, drawer);

const steps = [
  ["the tour shows the page in six steps", async () => {
    await page.goto(link);
    await viewer.until("a first picture", (now) => now.connection === "connected" && now.frames > 0);
    await page.click("#tour-button");
    for (let step = 1; step <= 6; step++) {
      check((await viewer.text("#tour")).includes(`${step} of 6`), `step ${step} says "${await viewer.text("#tour")}"`);
      if (step === 3) await filmed("tour");
      await page.locator("#tour button.primary").click();
    }
    check(await page.isHidden("#tour"), "the tour does not end");
  }],
  ["a low window has a picture, and nothing lies over the plots", async () => {
    for (const [width, height] of [[640, 400], [960, 540]]) {
      await page.setViewportSize({ width, height });
      await viewer.drawn();
      const [picture, tools, dock] = await page.evaluate(() => ["stage", "tools", "dock"].map((id) => {
        const { top, bottom, height } = document.getElementById(id).getBoundingClientRect();
        return { top, bottom, height };
      }));
      check(picture.height >= 200, `the picture is ${picture.height} high at ${width} x ${height}`);
      check(tools.bottom <= dock.top && dock.top <= height - 35, `the tools end at ${tools.bottom}, the plots begin at ${dock.top} at ${width} x ${height}`);
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await viewer.drawn();
  }],
  ["what would swing the ends away is not approved without a word", async () => {
    const ends = ["inlet", "outlet"];
    await page.selectOption("#action", "rotate");
    await page.check('input[aria-label="bypass: handle"]');
    for (const end of ends) await page.uncheck(`input[aria-label="${end}: fixed"]`);
    await viewer.field("degrees").fill("20");
    const words = await viewer.holds("what would move", () => { const said = document.getElementById("open-moved"); return !said.hidden && / would move /.test(said.innerText) && said.innerText; });
    check(/^(inlet \(inflow\)|outlet \(outflow\)) would move by \S+, \S+ % of the size, and (inlet|outlet) too\.$/.test(words), `the page says "${words}"`);
    const [said, button, amber] = await page.evaluate(() => {
      const swatch = document.body.appendChild(document.createElement("span"));
      swatch.style.color = "var(--low-text)";
      const colours = [...["open-moved", "apply"].map((id) => document.getElementById(id)), swatch].map((one) => getComputedStyle(one).color);
      swatch.remove();
      return colours;
    });
    check(said === amber && button === amber, `the word is ${said}, the button ${button}, not ${amber}`);
    await told();
    check((await viewer.text("#apply")) === "Apply anyway", `the button says "${await viewer.text("#apply")}"`);
    await filmed("ends-would-move", "right");
    await page.click("#cancel");
    check(await page.isHidden("#open-moved") && (await viewer.text("#apply")) === "Apply", "the warning is still there after Cancel");
    for (const end of ends) await page.check(`input[aria-label="${end}: fixed"]`);
    await page.uncheck('input[aria-label="bypass: handle"]');
    check((await viewer.look()).orders.length === 0, "an order was given");
  }],
  ["the graft is bent by 20 degrees", async () => {
    await page.click("#skeleton");
    await viewer.holds("the nodes of the skeleton", () => window.tombolo.skeleton?.places.length > 0);
    await page.getByLabel("bend at").selectOption({ label: "bypass · node 4" });
    await page.getByLabel("in the plane").selectOption("xy");
    await page.click("button.bend");
    await told();
    await filmed("bend", "right");
    const order = await viewer.apply();
    check(order.status === "applied", `the bend was refused: ${order.reason}`);
    await page.click("#skeleton");
    await viewer.holds("the bend in the list of edits", () => /^Bend at bypass/.test(document.querySelector("#stack .title")?.textContent ?? ""));
    await filmed("bent", "right");
  }],
  ["where the mesh is worst is shown", async () => {
    await page.click("#quality");
    await viewer.until("the worst cells", (now) => "worst cells" in now.views);
    await viewer.holds("ten outlines and rings around them", () => ["circle", "path"].every((shape) => document.querySelectorAll(`#marks ${shape}.cell`).length === 10));
    await filmed("worst");
    await page.click("#quality");
    await viewer.until("the worst cells gone", (now) => !("worst cells" in now.views));
  }],
  ["the pressure before and after stands beside the plot", async () => {
    await viewer.holds("before and after", () => [...document.querySelectorAll("#dock tbody tr")].some((row) => /^Pressure drop \[Pa\]$/.test(row.cells[0].innerText) && Number.parseFloat(row.cells[1].innerText) > 0 && Number.parseFloat(row.cells[2].innerText) > 0 && /%/.test(row.cells[3].innerText)));
    await filmed("pressure");
    // The same by the keyboard: another cycle, closer, the whole again.
    await page.focus('#dock [role="slider"]');
    await page.keyboard.press("ArrowLeft");
    await viewer.holds("an earlier cycle beside the plot", () => {
      const cycle = document.querySelector('#dock [role="slider"]').ariaValueText.split(";")[0];
      return /^cycle [0-9]+$/.test(cycle) && document.querySelector("#dock .table-title").textContent.startsWith(cycle);
    });
    for (const [key, isZoomed] of [["+", true], ["0", false]]) {
      await page.keyboard.press(key);
      check((await page.getByRole("button", { name: "Whole" }).isEnabled()) === isZoomed, `${key} in the plot does nothing`);
    }
  }],
  ["the first of two edits is changed", async () => {
    await page.selectOption("#action", "translate");
    await page.check('input[aria-label="bypass: handle"]');
    await viewer.field("by z").fill("0.001");
    await told();
    check((await viewer.apply()).status === "applied", "the second edit was refused");
    await viewer.until("two edits", (now) => now.stack.length === 2);
    await page.click('#stack [data-edit="0"] [data-act="load"]');
    check((await viewer.text("#apply")) === "Update edit 1", `the button says "${await viewer.text("#apply")}"`);
    // Half the bend, by the amount of the edit itself.
    const whole = (await viewer.look()).stack[0].skeleton.moves;
    await page.locator("#amount").fill("50");
    await told();
    await filmed("first-edit", "right");
    check((await viewer.apply()).status === "applied", "the change was refused");
    const { stack } = await viewer.until("two edits still, the first another one", (now) => now.stack.length === 2 && JSON.stringify(now.stack[0].skeleton.moves) !== JSON.stringify(whole));
    stack[0].skeleton.moves.forEach(({ by }, i) => by.forEach((part, k) => check(Math.abs(part - 0.5 * whole[i].by[k]) < 1e-9, `node ${i + 1} goes by ${by}, it was ${whole[i].by}`)));
  }],
  ["the wheel goes to a colleague", async () => {
    colleague = await Viewer.open(browser, "colleague");
    await colleague.page.goto(link);
    await colleague.until("watching", (now) => now.role === "watcher");
    await colleague.page.click("#wheel");
    await viewer.holds("the question", () => !document.getElementById("asked").hidden);
    await filmed("asked");
    await page.click("#hand-over");
    await colleague.until("the wheel", (now) => now.role === "driver");
    await filmed("handed-over", "right");
  }],
  ["all of it is taken back", async () => {
    for (let left = 3; left > 0; left--) {
      const before = new Set((await colleague.look()).orders.map((order) => order.id));
      await colleague.page.click("#undo");
      await colleague.settled(before);
    }
    await colleague.until("no edits", (now) => now.stack.length === 0);
    await viewer.until("no edits here either", (now) => now.stack.length === 0);
    await colleague.filmed("taken-back", "right");
  }],
  ["one view alone, for a page of one's own", async () => {
    const bare = new URL(page.url());
    bare.search = "?view=midplane";
    await page.goto(bare.toString());
    await viewer.until("a picture", (now) => now.frames > 0);
    for (const selector of ["header", "#left", "#right", "#dock", "#tools"]) check(await page.isHidden(selector), `${selector} is shown beside the view`);
    await filmed("alone");
  }],
  ["nothing went wrong on the way", async () => {
    const complaints = [viewer, colleague].flatMap((one) => one?.complaints ?? []);
    check(complaints.length === 0, complaints.join("\n"));
  }],
];

await run(steps, () => [viewer, colleague].filter(Boolean), () => browser.close());
