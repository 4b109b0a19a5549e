/**
 * Shapes a running flow by hand, in Debian's Chromium: by mouse, keyboard and touch. Gives no order; what is composed is read in the
 * page.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... [TOMBOLO_HANDLE=throat] node tests/browser/handles.mjs
 *
 * TOMBOLO_HANDLE is the feature that is shaped (default throat), such as `bypass`; the other variables are those of page.mjs.
 */
import { Viewer, check, launch, link, patience, run } from "./page.mjs";

const HANDLE = process.env.TOMBOLO_HANDLE ?? "throat";
const browser = await launch();
const viewer = await Viewer.open(browser, "handles", { hasTouch: true });
const { page } = viewer;
const drawn = () => viewer.drawn();
const picture = (name, shown) => viewer.picture(name, shown);
const values = (label) => Promise.all(["x", "y", "z"].map(async (axis) => Number(await page.inputValue(`.object:not([hidden]) input[aria-label$="${label} ${axis}"]`))));
const preview = async () => {
  await page.waitForFunction(() => window.tombolo.preview.state === "shown");
  return page.evaluate(() => window.tombolo.preview);
};
async function gizmo(part) {
  await drawn();
  const place = (await page.evaluate(() => window.tombolo.gizmo))[part];
  check(place, `the gizmo has no ${part}`);
  return place;
}
async function drag([x, y], [dx, dy]) {
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx, y + dy, { steps: 6 });
}
const nothing = async () => page.waitForFunction(() => window.tombolo.preview.state === "none");
const cancel = async () => {
  if (await page.isVisible("#cancel")) await page.click("#cancel");
  await nothing();
};

const steps = [
  ["a click makes the handle, and its gizmo appears", async () => {
    await page.goto(link);
    await page.waitForFunction(() => window.tombolo?.frames > 0);
    await drawn();
    // Seen along x, no arrow that is dragged here points at the one who looks.
    await page.click('[data-camera="0"]');
    await drawn();
    const place = await viewer.place(HANDLE);
    check(place, `${HANDLE} cannot be seen`);
    await page.mouse.click(...place);
    await gizmo("arrow z");
    await picture("gizmo", "gizmo.png");
  }],
  ["the box and a typed value scale by exactly 0.5", async () => {
    await drag(await gizmo("box z"), [0, 12]);
    await page.keyboard.type("0.5");
    await page.mouse.up();
    await page.keyboard.press("Enter");
    const factors = await values("factors");
    check(JSON.stringify(factors) === "[1,1,0.5]", `the factors are ${factors}`);
    check((await preview()).largest > 0, "nothing moves");
    await picture("pinched");
    await cancel();
  }],
  ["an arrow moves along its axis and exactly by 0 across it", async () => {
    await drag(await gizmo("arrow z"), [17, -30]);
    const [x, y, z] = await values("by");
    check(x === 0 && y === 0 && z > 0, `the translation is ${[x, y, z]}`);
    await page.keyboard.press("y");
    const [a, b, c] = await values("by");
    check(a === 0 && b !== 0 && c === 0, `locked to y the translation is ${[a, b, c]}`);
    await picture("arrow");
    await page.keyboard.press("Escape");
    await page.mouse.up();
    await nothing();
  }],
  ["a ring turns, by round steps with ctrl, and Escape brings back what was there", async () => {
    const ring = await gizmo("ring x");
    await drag(ring, [-20, 25]);
    await page.keyboard.down("Control");
    await page.mouse.move(ring[0] - 60, ring[1] + 75, { steps: 3 });
    const degrees = Number(await page.inputValue('.object:not([hidden]) input[aria-label$="degrees"]'));
    check(degrees !== 0 && degrees % 5 === 0, `it turns by ${degrees}`);
    await page.keyboard.up("Control");
    await page.keyboard.press("Escape");
    await page.mouse.up();
    await nothing();
  }],
  ["the keyboard alone moves it", async () => {
    await page.focus("#scene");
    await page.keyboard.press("g");
    await page.keyboard.press("y");
    await page.keyboard.type("0.004");
    await page.keyboard.press("Enter");
    check(JSON.stringify(await values("by")) === "[0,0.004,0]", `the translation is ${await values("by")}`);
    // The handle goes just that far; what follows it smoothly may go a little beyond.
    const { largest } = await preview();
    check(largest > 0.004 - 1e-9 && largest < 0.0044, `the preview moves by up to ${largest}`);
    await cancel();
  }],
  ["a finger moves it", async () => {
    const [x, y] = await gizmo("arrow z");
    const session = await page.context().newCDPSession(page);
    const touch = (type, points) => session.send("Input.dispatchTouchEvent", { type, touchPoints: points });
    await touch("touchStart", [{ x: x + 8, y }]);
    for (const up of [6, 12, 24]) await touch("touchMove", [{ x: x + 8, y: y - up }]);
    await touch("touchEnd", []);
    const [a, b, c] = await values("by");
    check(a === 0 && b === 0 && c > 0, `the translation is ${[a, b, c]}`);
    await cancel();
  }],
  ["a lasso chooses faces as the region", async () => {
    await page.click("#faces");
    await page.waitForTimeout(200);
    const box = await page.locator("#scene").boundingBox();
    const [cx, cy] = [box.x + box.width / 2, box.y + box.height / 2];
    const lasso = [[-70, -90], [70, -90], [70, 90], [-70, 90]];
    const end = Date.now() + patience;
    let count = 0;
    // The surface arrives once, when it is first needed.
    while (count === 0 && Date.now() < end) {
      await page.mouse.move(cx + lasso[0][0], cy + lasso[0][1]);
      await page.mouse.down();
      for (const [x, y] of lasso) await page.mouse.move(cx + x, cy + y, { steps: 3 });
      await page.mouse.up();
      await page.waitForTimeout(300);
      count = Number.parseInt(await page.locator(".face-tools output").innerText(), 10) || 0;
    }
    check(count > 10, `${count} faces are chosen`);
    await picture("lasso");
    await page.keyboard.press("Escape");
    check((await page.evaluate(() => window.tombolo.selection.handle)).length === 0, "the feature is still the handle");
    await drag(await gizmo("arrow z"), [0, -20]);
    await page.mouse.up();
    check((await preview()).largest > 0, "the faces do not move");
    console.log(`    ${count} faces`);
    await page.keyboard.press("Escape");
    await cancel();
  }],
  ["a node of the skeleton bends its branch by exactly 20 degrees", async () => {
    await page.click("#skeleton");
    await page.waitForFunction(() => window.tombolo.skeleton);
    await drawn();
    const places = await page.evaluate(() => window.tombolo.skeleton.places);
    let chosen = null;
    for (const place of places) {
      await page.mouse.move(...place);
      const name = await page.evaluate(() => document.getElementById("tip").textContent);
      if (name.startsWith(HANDLE) || chosen === null) chosen = { place, name };
      if (name.startsWith(HANDLE) && /node 4$/.test(name)) break;
    }
    check(/ · node \d$/.test(chosen.name), `the node is called "${chosen.name}"`);
    await page.mouse.click(...chosen.place);
    const part = await page.evaluate(() => Object.keys(window.tombolo.gizmo).find((name) => name.startsWith("ring")));
    await drag(await gizmo(part), [6, 14]);
    await page.keyboard.type("20");
    await page.mouse.up();
    await page.keyboard.press("Enter");
    check((await preview()).largest > 0, "nothing bends");
    const moves = await page.locator('.object:not([hidden]) .entry input[aria-label$=" by x"]').count();
    check(moves >= 2, `${moves} nodes are dragged`);
    console.log(`    ${chosen.name}, ${part}, ${moves} drags`);
    await picture("bent");
    await cancel();
  }],
  ["a node is bent about by 20 degrees in a plane, in numbers: one edit", async () => {
    const names = await page.locator('[aria-label="Bending the skeleton"] select').first().locator("option").allInnerTexts();
    const name = names.find((text) => text.startsWith(HANDLE) && /node [34]$/.test(text)) ?? names.find((text) => /node 4$/.test(text));
    check(name, `there are the nodes ${names.join(", ")}`);
    await page.getByLabel("bend at").selectOption({ label: name });
    await page.getByLabel("in the plane").selectOption("yz");
    await page.click("button.bend");
    check((await preview()).largest > 0, "nothing bends");
    const bends = await page.locator('.object:not([hidden]) .entry input[aria-label$=" by x"]').count();
    check(bends >= 2, `${bends} nodes are dragged`);
    await picture("bend");
    // Taken back as one.
    await page.keyboard.press("Control+z");
    await nothing();
    console.log(`    ${name}, ${bends} drags`);
    await page.click("#skeleton");
    await page.waitForSelector("button.bend", { state: "hidden" });
  }],
  ["nothing went wrong on the way", async () => check(viewer.complaints.length === 0, viewer.complaints.join("\n"))],
];

await run(steps, () => [viewer], () => browser.close());
