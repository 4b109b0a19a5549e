/**
 * Watches a recording that `tombolo play` shows, in Debian's Chromium: it goes on by itself to its end, the slider is dragged back and
 * forth by hand and by keys, what is seen can be measured as in a run, and nothing can be ordered.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/recording.mjs
 *
 * The recording is that of a nozzle whose throat an order pinches to eight tenths about half way. The variables are those of page.mjs.
 */
import { statSync } from "node:fs";
import { Fingers, Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "recording", { acceptDownloads: true });
const { page } = viewer;
const button = (text) => viewer.holds(`the button "${text}"`, (wanted) => document.getElementById("play").textContent === wanted, text);
/** Where the slider stands, from 0 at its beginning to 1 at its end. */
const stand = () => page.evaluate(() => {
  const { min, max, value } = document.getElementById("moment");
  return (Number(value) - Number(min)) / (Number(max) - Number(min));
});
/** Drags the slider from one place to another, from 0 at its left end to 1 at its right one. */
const drag = async (from, to) => {
  const box = await page.locator("#moment").boundingBox();
  const x = (part) => box.x + part * box.width;
  const y = box.y + box.height / 2;
  await page.mouse.move(x(from), y);
  await page.mouse.down();
  await page.mouse.move(x(to), y, { steps: 10 });
  await page.mouse.up();
};
/** Waits until the throat has this height, as a part of that it had at first. */
const height = (part) => viewer.until(`a throat of ${part} of its height`, async () => Math.abs((await viewer.extent("throat", 2)) / 0.1 - part) < 0.005);
const cycle = async () => Number((await viewer.text("#moment-text")).match(/^cycle (\d+), time \S+$/)?.[1]);
/** Waits until no more comes: what the slider asked for on its way has been shown too. */
const rest = async () => {
  for (let before = ""; ;) {
    const now = `${(await viewer.look()).frames} ${await viewer.text("#moment-text")}`;
    if (now === before) return;
    before = now;
    await page.waitForTimeout(600);
  }
};
let last = null;

const steps = [
  ["a recording goes on by itself to its end, which is not that of the connection", async () => {
    await page.goto(link);
    const { role } = await viewer.until("a first picture", (now) => now.connection === "connected" && now.frames > 0);
    check(role === "watcher", `the viewer of a recording is ${role}`);
    check(!page.url().includes("token"), `the secret stays in ${page.url()}`);
    check(await page.locator("#moment").isVisible(), "there is no slider");
    await button("Again");
    await height(0.8);
    last = await viewer.look();
    check(last.connection === "connected" && last.end === null && last.stack.length === 1, `at its end it is ${last.connection}, ${JSON.stringify(last.end)}, with the edits ${JSON.stringify(last.stack)}`);
    check((await stand()) > 0.999, `the slider stands at ${await stand()}`);
    await viewer.picture("end");
  }],
  ["it begins again, and rests", async () => {
    await page.selectOption("#speed", "0.25");
    await page.click("#play");
    await button("Pause");
    const told = (state) => viewer.holds(`"recording (${state})"`, (words) => document.getElementById("run").textContent === words, `recording (${state})`);
    await told("playing");
    await page.click("#play");
    await button("Play");
    await told("paused");
  }],
  ["the slider, dragged, shows another cycle with the shape that it had", async () => {
    await drag(0.8, 0.25);
    const isBefore = async ({ stack, cycle: shown }) => stack.length === 0 && shown < last.cycle / 2 && (await cycle()) < last.cycle / 2 && (await stand()) < 0.35;
    await viewer.until("the moment of before the order", isBefore);
    await height(1);
    await rest();
    check(await isBefore(await viewer.look()), `it is paused, and went on: ${await viewer.text("#moment-text")}`);
    const { pixels } = await viewer.drawn();
    await viewer.picture("before");
    await drag(0.25, 0.8);
    await viewer.until("the moment of behind the order", async ({ stack, cycle: shown }) => stack.length === 1 && shown > last.cycle / 2 && (await cycle()) > last.cycle / 2 && (await stand()) > 0.65);
    await height(0.8);
    // The picture comes a moment after the numbers.
    await viewer.until("another picture than that of before", async () => (await viewer.drawn()).pixels !== pixels);
  }],
  ["the same tools serve as in a run: pins, ruler, histogram, before and after, film, and the slider by keys", async () => {
    await page.mouse.move(...(await viewer.place("throat")));
    await viewer.holds("the value beside the pointer", () => /^throat\n/.test(document.getElementById("tip").innerText));
    await page.keyboard.press("p");
    await viewer.holds("the pin", () => document.querySelectorAll("#marks circle.probe").length === 1);
    await viewer.holds("the pin in the plot", () => [...document.querySelectorAll("#dock tbody th")].some((name) => /^\s*(probe )?1: /.test(name.textContent)));
    await page.locator("#scene").press("m");
    for (const feature of ["upstream", "downstream"]) await page.mouse.click(...(await viewer.place(feature)));
    const distance = await viewer.holds("the distance", () => document.querySelector("#marks text.ruler")?.textContent);
    check(Number.parseFloat(distance) > 0.2 && Number.parseFloat(distance) < 1.06, `the ruler says ${distance}`);
    await page.locator("#scene").press("m");
    await page.getByRole("tab", { name: "Histogram" }).click();
    const bins = () => document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr").length >= 1;
    await viewer.holds("the histogram", bins);
    await page.click("#compare");
    await viewer.holds("the moment before the order", () => /^before /.test(document.querySelector("#before .caption")?.textContent ?? ""));
    await viewer.picture("tools");
    await viewer.clean("with the tools");
    await page.click("#compare");
    // What is filmed changes by the slider, which the keys move.
    await page.click("#movie");
    await page.focus("#moment");
    for (const [key, isThere] of [["ArrowLeft", (now, before) => now < before], ["ArrowRight", (now, before) => now > before]]) {
      const before = await cycle();
      // A step of the slider may be less than one of the recording.
      for (let press = 0; press < 6; press++) await page.keyboard.press(key);
      await viewer.until(`another moment by ${key}`, async () => isThere(await cycle(), before));
    }
    const waiting = page.waitForEvent("download");
    await page.click("#movie");
    const { size } = statSync(await (await waiting).path());
    check(size > 1000, `the film has ${size} bytes`);
    await page.focus("#moment");
    await page.keyboard.press("Home");
    await viewer.until("its beginning", async ({ stack }) => (await stand()) < 0.001 && stack.length === 0);
    await height(1);
  }],
  ["what needs the run is said in words", async () => {
    const why = "This is a recording: it can be watched, and not be steered.";
    const quality = page.getByRole("button", { name: "Colour by mesh quality" });
    check(await quality.isDisabled() && (await quality.getAttribute("title")) === why, "the quality of the mesh is offered");
    for (const name of ["Skeleton", "Faces"]) {
      const tool = page.getByRole("button", { name, exact: true });
      const title = await tool.getAttribute("title");
      check(await tool.isDisabled() && title === "This is a recording: the surface from which shapes are measured is not in it.", `${name} is offered, or says "${title}"`);
    }
    const refused = (what) => viewer.holds(what, (words) => { const said = document.getElementById("refusal"); return !said.hidden && said.textContent.includes(words) && said.textContent; }, why);
    await page.click("#quality");
    const cells = await refused("why there are no worst cells");
    await page.locator("#scene").press("l");
    for (const feature of ["upstream", "downstream"]) await page.mouse.click(...(await viewer.place(feature)));
    await viewer.holds("other words", (before) => document.getElementById("refusal").textContent !== before, cells);
    console.log(`    ${cells} | ${await refused("why there is no line")}`);
    await viewer.picture("words");
  }],
  ["the slider goes with a finger", async () => {
    const box = await page.locator("#moment").boundingBox();
    await new Fingers(viewer).drag([box.x + 0.8 * box.width, box.y + box.height / 2], [-0.55 * box.width, 0]);
    await viewer.until("the moment of before the order", async ({ stack, cycle: shown }) => stack.length === 0 && shown < last.cycle / 2 && (await cycle()) < last.cycle / 2 && (await stand()) > 0.1 && (await stand()) < 0.4);
    await height(1);
    await viewer.picture("finger");
  }],
  ["nothing can be ordered of it", async () => {
    const { orders, stack } = await viewer.look();
    const why = await page.getAttribute("#pause", "title");
    check(why === "This is a recording: it can be watched, and not be steered.", `the page says "${why}"`);
    for (const selector of ["#apply", "#undo", "#redo", "#pause"]) check(await page.locator(selector).isDisabled(), `${selector} can be pressed`);
    for (const selector of ["#wheel", "#pipelines-panel"]) check(await page.locator(selector).isHidden(), `${selector} is offered`);
    await page.focus("#scene");
    await page.keyboard.press("Control+z");
    // An order is listed by the page before it is sent.
    const seen = await viewer.look();
    check(JSON.stringify([seen.orders, seen.stack]) === JSON.stringify([orders, stack]), "Ctrl+Z took something back");
    check(seen.errors.length === 0, JSON.stringify(seen.errors));
    check(viewer.complaints.length === 0, viewer.complaints.join("\n"));
  }],
];

await run(steps, () => [viewer], () => browser.close());
