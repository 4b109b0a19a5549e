/**
 * Compares a running nozzle before and after a pinch as an engineer would, in Debian's Chromium: the pressure along a line, the picture
 * side by side, how values are spread, a slice dragged in the picture, a film.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/comparing.mjs
 *
 * The variables are those of page.mjs.
 */
import { readFileSync, statSync } from "node:fs";
import { Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const viewer = await Viewer.open(browser, "comparing", { acceptDownloads: true });
const { page } = viewer;
// Read in one go: the run goes on, and with it what the table says.
const rows = () => page.evaluate(() => [...document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr")].map((row) => [...row.cells].map((cell) => cell.textContent).join("\t")));
const numberOf = (text) => Number(text.trim().replace("−", "-"));
/** The numbers of a row of the table beside the plot. */
const numbers = (row) => row.split("\t").slice(1).map(numberOf);
/** What is downloaded when a button is pressed. */
const saved = async (name) => {
  const waiting = page.waitForEvent("download");
  await page.getByRole("button", { name, exact: true }).click();
  const file = await waiting;
  const path = await file.path();
  return { name: file.suggestedFilename(), path };
};
const setLook = async (field) => {
  await page.locator("#look select").first().selectOption(field);
};

const shared = {};
const steps = [
  ["a slice is dragged along its normal in the picture", async () => {
    await page.goto(link);
    await viewer.until("a first picture", (now) => now.connection === "connected" && now.frames > 0);
    await page.click('[data-camera="corner"]');
    await viewer.drawn();
    const grip = await viewer.holds("a handle on the slice", () => window.tombolo.sliceHandle);
    const [x, y] = grip;
    await page.mouse.move(x, y);
    await page.mouse.down();
    for (let step = 1; step <= 5; step++) await page.mouse.move(x - 3 * step, y + step);
    await viewer.picture("slice-dragged");
    await page.mouse.up();
    const offset = await viewer.holds("the cut where it was dragged to", () => {
      const said = Number(document.querySelector("#slice input[type=text]").value.replace("−", "-"));
      return said !== 0 && Math.abs(window.tombolo.views.midplane.bounds[0][0] - said) < 1e-3 && said;
    });
    check(Math.abs(offset) < 0.025, `the slice was dragged to ${offset}`);
    await page.fill("#slice input[type=text]", "0");
    await page.keyboard.press("Enter");
    await viewer.holds("the cut in the middle again", () => Math.abs(window.tombolo.views.midplane.bounds[0][0]) < 1e-3);
  }],
  ["the pressure is plotted over a line between two clicks", async () => {
    await page.click('[data-camera="0"]');
    await setLook("pressure");
    await viewer.drawn();
    await page.click("#line");
    for (const end of ["upstream", "downstream"]) await page.mouse.click(...(await viewer.place(end)));
    await viewer.until("the view of the line", (now) => now.views.line?.points > 100);
    await viewer.holds("the profile beside the plot", () => document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr").length === 1);
    check((await page.locator('#dock [role="tab"][aria-selected="true"]').innerText()) === "Line", "the plot is not in front");
    check((await page.locator("#line").getAttribute("aria-pressed")) === "false", "the tool still takes clicks");
    const [least, mean, largest] = numbers((await rows())[0]);
    check(least < mean && mean < largest, `the profile says ${least}, ${mean}, ${largest}`);
    const ends = await page.evaluate(() => [...document.querySelectorAll("#dock .ends input")].map((input) => Number(input.value.replace("−", "-"))));
    check(ends[1] < 0 && ends[4] > 0 && ends[4] - ends[1] > 0.2, `the line goes from and to ${ends}`);
    await viewer.picture("line");
    await viewer.clean("with the line");
    // Exactly along the axis, by numbers.
    for (const [label, value] of [["from x", 0], ["from y", -0.5], ["from z", 0], ["to x", 0], ["to y", 0.5], ["to z", 0]]) {
      await page.getByLabel(label, { exact: true }).fill(String(value));
      await page.keyboard.press("Enter");
    }
    await viewer.until("the line along the axis", ({ views }) => Math.abs(views.line.bounds[0][1] + 0.5) < 1e-3 && Math.abs(views.line.bounds[1][1] - 0.5) < 1e-3 && Math.abs(views.line.bounds[0][2]) < 1e-3);
  }],
  ["after a pinch the line, the histogram and the picture have before and now", async () => {
    await page.selectOption("#action", "scale_direction");
    await page.check('input[aria-label="throat: handle"]');
    await viewer.field("factors z").fill("0.7");
    await viewer.until("the forecast", ({ forecast }) => forecast.state === "told");
    // Of so many cycles that the order is still under way when the page, however slow, has been looked at.
    await viewer.scheduled(10, 30);
    // Every range that the bar shows while the order changes the shape, and the cycles of the frames that it is shown with.
    await page.evaluate(() => {
      window.seen = { ranges: new Set(), cycles: new Set() };
      const watching = setInterval(() => {
        const status = window.tombolo.orders.at(-1)?.status;
        if (status === "applying") {
          window.seen.ranges.add([...document.querySelectorAll(".scalar-bar input")].map((end) => end.value).join(" to "));
          window.seen.cycles.add(window.tombolo.views.midplane.cycle);
        } else if (status === "applied" || status === "rejected") clearInterval(watching);
      }, 20);
    });
    const rests = async (paused) => {
      await page.click("#pause");
      await viewer.until(paused ? "the run paused" : "the run going on", (now) => now.status?.paused === paused);
    };
    await page.click("#apply");
    await viewer.until("shapes and frames on the way", ({ orders }) => {
      check(orders.at(-1)?.status !== "rejected", `the pinch was refused: ${orders.at(-1)?.reason}`);
      return orders.length === 1 && orders[0].status === "applying" && orders[0].shape >= 2;
    });
    await rests(true);
    await viewer.clean("with an order under way");
    const { orders: [underWay] } = await viewer.look();
    check(underWay.status === "applying", `axe has looked at an order that is ${underWay.status}`);
    await rests(false);
    const order = await viewer.settled(new Set());
    check(order.status === "applied", `the pinch was refused: ${order.reason}`);
    // The orders after it are as quick as they were.
    await viewer.scheduled(10, 2);
    await page.click(".schedule summary");
    const { ranges, cycles } = await page.evaluate(() => ({ ranges: [...window.seen.ranges], cycles: [...window.seen.cycles] }));
    check(ranges.length === 1 && cycles.length > 1, `while the order was under way, with frames of ${cycles.length} cycles, the range was ${ranges.join(", then ") || "not seen"}`);
    await viewer.holds("another range after it", (before) => [...document.querySelectorAll(".scalar-bar input")].map((end) => end.value).join(" to ") !== before, ranges[0]);
    shared.order = order;
    await viewer.holds("both profiles", () => document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr").length === 2);
    // The throat is narrower, so the flow is faster in it, and more pressure is needed to drive it.
    await viewer.holds("more pressure than before", () => {
      const [now, before] = [...document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr")].map((row) => Number(row.querySelectorAll("td")[2].textContent.replace("−", "-")));
      return now > 1.05 * before;
    });
    const lines = await rows();
    check(/^before “Throat: height × 0\.7”/.test(lines[1].trim()), `the second row is "${lines[1]}"`);
    console.log(`    ${lines.map((row) => row.replace(/\s+/g, " ").trim()).join("; ")}`);
    await viewer.picture("line-before-and-now");
    await page.getByRole("tab", { name: "Histogram" }).click();
    await viewer.holds("both histograms", () => document.querySelectorAll("#dock .dock-body:not([hidden]) tbody tr").length === 2);
    await viewer.clean("with the histogram");
    await page.click("#compare");
    await viewer.drawn();
    check(/^before “Throat: height × 0\.7”/.test(await viewer.text("#before .caption")), "the other picture does not say what it came before");
    await viewer.picture("compared", "compared.png");
    await viewer.clean("side by side");
    const [left, right, bars] = await page.evaluate(() => [".before-scene", "#scene", "#bars"].map((selector) => document.querySelector(selector).getBoundingClientRect().toJSON()));
    check(Math.abs(left.width - right.width) < 4, `the pictures are ${left.width} and ${right.width} wide`);
    check(bars.left >= right.right, `the bars begin at ${bars.left}, the picture of now ends at ${right.right}`);
  }],
  ["the history has values, what they were before and the difference under the pointer, in numbers that a file has too", async () => {
    await page.getByRole("tab", { name: "History" }).click();
    const over = page.locator("#dock .dock-body:not([hidden]) .u-over");
    const { x, y, width, height } = await over.boundingBox();
    /** What the table says with the pointer at a part of the width. */
    const at = async (part) => {
      await page.mouse.move(x + part * width, y + height / 2);
      const read = () => page.evaluate(() => {
        const body = document.querySelector("#dock .dock-body:not([hidden])");
        const row = [...body.querySelectorAll("tbody tr")].find((one) => /^Pressure drop/.test(one.textContent));
        return { title: body.querySelector(".table-title").textContent, cells: [...row.querySelectorAll("td")].map((cell) => cell.textContent), hint: row.querySelector("td:last-child").title };
      });
      return read();
    };
    const early = await at(0.02);
    check(/^cycle \d+$/.test(early.title) && early.cells[1] === "–" && early.cells[2] === "–", `before the order it says ${JSON.stringify(early)}`);
    const late = await at(0.99);
    const { cycle } = late.title.match(/^cycle (?<cycle>\d+) · before: Throat: height × 0\.7$/)?.groups ?? {};
    check(Number(cycle) > shared.order.cycle_applied, `after the order it says ${JSON.stringify(late)}`);
    const [value, before] = late.cells.slice(0, 2).map(numberOf);
    const [, plain, percent] = late.hint.match(/^\+(\S+) \(\+(\S+)\u00a0%\)$/) ?? [];
    check(Math.abs(Number(plain) / (value - before) - 1) < 0.02 && Math.abs(Number(percent) / (100 * (value - before) / before) - 1) < 0.02 && late.cells[2] === `+${percent}\u00a0%`,
      `the difference of ${value} and ${before} is "${late.cells[2]}", "${late.hint}"`);
    await viewer.picture("history-hover");
    const csv = await saved("CSV");
    const [names, ...lines] = readFileSync(csv.path, "utf8").trim().split("\n").map((line) => line.split(","));
    const column = names.findIndex((name) => /pressure drop/.test(name));
    const line = lines.find(([first]) => first === cycle);
    check(names[0] === "cycle" && names[1] === "time" && column > 1 && line, `${csv.name} has the columns ${names}, ${lines.length} lines and none of cycle ${cycle}`);
    check(Number(Number(line[column]).toPrecision(4)) === value, `at cycle ${cycle} the file says ${line[column]}, the page ${value}`);
    // A drag zooms to what is under it.
    await page.mouse.move(x + 0.5 * width, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + 0.8 * width, y + height / 2, { steps: 4 });
    await page.mouse.up();
    const whole = page.getByRole("button", { name: "Whole", exact: true });
    check(await whole.isEnabled(), "a drag does not zoom");
    const [first, last] = [await at(0.02), await at(0.98)].map(({ title }) => Number(title.match(/^cycle (\d+)/)[1]));
    const all = [Number(early.title.match(/\d+/)[0]), Number(cycle)];
    check(first > all[0] && last < all[1] + 50 && last - first < 0.6 * (all[1] - all[0]), `zoomed it goes from ${first} to ${last}, before from ${all[0]} to ${all[1]}`);
    await whole.click();
    check(Number((await at(0.02)).title.match(/^cycle (\d+)/)[1]) < first, "the whole is not there again");
    console.log(`    cycle ${cycle}: ${late.cells.join(", ")}; ${csv.name}: ${lines.length} lines`);
  }],
  ["both pictures are seen from the same place", async () => {
    // The one of before is dragged, and the one of now turns with it.
    const first = await viewer.drawn();
    const box = await page.locator(".before-scene").boundingBox();
    await page.mouse.move(box.x + 60, box.y + box.height - 80);
    await page.mouse.down();
    await page.mouse.move(box.x + 140, box.y + box.height - 120, { steps: 4 });
    await page.mouse.up();
    await viewer.until("the picture of now turned", async () => (await viewer.drawn()).pixels !== first.pixels);
    await viewer.picture("compared-turned");
    for (const [width, height] of [[1920, 1080], [820, 1180]]) {
      await page.setViewportSize({ width, height });
      await viewer.drawn();
      await viewer.picture(`compared-${width}`);
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.click("#compare");
    check(await page.isHidden("#before"), "the other picture stays");
  }],
  ["the picture is filmed", async () => {
    await page.click("#movie");
    const before = await viewer.look();
    await viewer.until("more frames", (now) => now.frames > before.frames + 4);
    const waiting = page.waitForEvent("download");
    await page.click("#movie");
    const film = await waiting;
    check(/^tombolo-\d+\.(webm|mp4)$/.test(film.suggestedFilename()), `the film is called ${film.suggestedFilename()}`);
    const { size } = statSync(await film.path());
    check(size > 5000, `the film has ${size} bytes`);
    // The scalar bar is in it: the corner where it stands has the colours of both ends.
    const other = await browser.newPage();
    const ends = await other.evaluate(async ([bytes, type]) => {
      const video = Object.assign(document.createElement("video"), { muted: true, src: `data:${type};base64,${bytes}` });
      const shown = new Promise((resolve, reject) => {
        video.requestVideoFrameCallback(resolve);
        video.onerror = () => reject(new Error("the film cannot be played"));
      });
      document.body.append(video);
      await video.play();
      await shown;
      const canvas = Object.assign(document.createElement("canvas"), { width: video.videoWidth, height: video.videoHeight });
      const context = canvas.getContext("2d");
      context.drawImage(video, 0, 0);
      const [width, height] = [140, 270];
      const { data } = context.getImageData(canvas.width - width, canvas.height - height, width, height);
      const ends = { yellow: 0, violet: 0 };
      for (let at = 0; at < data.length; at += 4) {
        const [red, green, blue] = data.subarray(at, at + 3);
        if (red > 190 && green > 180 && blue < 110) ends.yellow++;
        if (red < 110 && green < 70 && blue > 50) ends.violet++;
      }
      return ends;
    }, [readFileSync(await film.path()).toString("base64"), film.suggestedFilename().endsWith("mp4") ? "video/mp4" : "video/webm"]);
    await other.close();
    check(ends.yellow > 20 && ends.violet > 20, `the corner of the scalar bar has ${ends.yellow} pixels of its upper end and ${ends.violet} of its lower one`);
    console.log(`    ${film.suggestedFilename()}, ${size} bytes`);
  }],
  ["edits go into a file and come back; the surface and the view go into files", async () => {
    await page.click("#files summary");
    const { stack } = await viewer.look();
    const edits = await saved("Save edits");
    check(JSON.stringify(JSON.parse(readFileSync(edits.path, "utf8")).stack) === JSON.stringify(stack), "the file has other edits");
    const surface = await saved("Surface (STL)");
    const triangles = readFileSync(surface.path).readUInt32LE(80);
    check(triangles > 1000 && statSync(surface.path).size === 84 + 50 * triangles, `${surface.name} has ${triangles} triangles`);
    const moved = await saved("Displacement (CSV)");
    const [heads, ...vertices] = readFileSync(moved.path, "utf8").trim().split("\n");
    const largest = Math.max(...vertices.map((line) => Math.hypot(...line.split(",").slice(3).map(Number))));
    check(heads === "x,y,z,dx,dy,dz" && Math.abs(largest / shared.order.largest_displacement - 1) < 1e-5, `by ${moved.name} the surface has moved by up to ${largest}, by the order ${shared.order.largest_displacement}`);
    const view = await saved("View (VTP)");
    check(/Name="pressure"/.test(readFileSync(view.path, "utf8")), `${view.name} has no pressure`);
    let known = new Set((await viewer.look()).orders.map((order) => order.id));
    await page.click("#undo");
    await viewer.settled(known);
    await viewer.until("no edits", (now) => now.stack.length === 0);
    known = new Set((await viewer.look()).orders.map((order) => order.id));
    await page.setInputFiles("#files input[type=file]", edits.path);
    check((await viewer.settled(known)).status === "applied", "the edits of the file were refused");
    await viewer.until("the edits of the file", (now) => JSON.stringify(now.stack) === JSON.stringify(stack));
    // What is refused is listed with its reason.
    known = new Set((await viewer.look()).orders.map((order) => order.id));
    const folded = [...stack, { translate: { features: ["throat"], fixed: ["inlet", "outlet"], by: [0, 0.5, 0] } }];
    await page.setInputFiles("#files input[type=file]", { name: "folded.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify({ stack: folded })) });
    const refused = await viewer.settled(known);
    check(refused.status === "rejected" && refused.reason, `edits that fold the wall are ${refused.status}`);
    await viewer.holds("the refused order in the list", () => document.querySelector("#edits-panel .orders li")?.checkVisibility());
    await viewer.picture("refused");
    await viewer.clean("with a refused order");
    await page.click('#stack [data-act="rename"]');
    await viewer.clean("while an edit is renamed");
    await page.keyboard.press("Escape");
    console.log(`    ${edits.name}, ${surface.name} (${triangles} triangles), ${view.name}`);
  }],
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

await run(steps, () => [viewer], () => browser.close());
