/**
 * Shapes a running flow by hand, in Debian's Chromium: by mouse, keyboard, touch and pen. Gives no order; what is composed is read in the
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
    check(await page.isVisible(".gizmo-value"), "no number stands at the cursor");
    await viewer.clean("with the number at the cursor");
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
    // Two zoom, also where the first lies on a handle.
    const far = () => page.evaluate(() => { const { position, focalPoint } = window.tombolo.camera; return Math.hypot(...position.map((part, k) => part - focalPoint[k])); });
    const before = await far();
    const [left, top] = await gizmo("arrow z");
    const two = (apart) => [{ x: left + 8, y: top - apart, id: 0 }, { x: left + 8, y: top + 60 + apart, id: 1 }];
    await touch("touchStart", two(0).slice(0, 1));
    await touch("touchStart", two(0));
    for (const apart of [5, 10, 20, 30]) await touch("touchMove", two(apart));
    await touch("touchEnd", []);
    await drawn();
    const after = await far();
    check(after < 0.9 * before, `a pinch has gone from ${before} to ${after}`);
    await nothing();
    await page.click('[data-camera="0"]');
  }],
  ["a pen moves it", async () => {
    const [x, y] = await gizmo("arrow z");
    const session = await page.context().newCDPSession(page);
    const pen = (type, up, buttons) => session.send("Input.dispatchMouseEvent", { type, x, y: y - up, button: type === "mouseMoved" ? "none" : "left", buttons, pointerType: "pen", clickCount: 1, force: 0.5 });
    await page.evaluate(() => window.addEventListener("pointerdown", ({ pointerType }) => { window.pressedBy = pointerType; }, { capture: true, once: true }));
    await pen("mouseMoved", 0, 0);
    await pen("mousePressed", 0, 1);
    for (const up of [6, 12, 24]) await pen("mouseMoved", up, 1);
    await pen("mouseReleased", 24, 0);
    check((await page.evaluate(() => window.pressedBy)) === "pen", "it was no pen");
    const [a, b, c] = await values("by");
    check(a === 0 && b === 0 && c > 0, `the translation is ${[a, b, c]}`);
    await cancel();
  }],
  ["a square moves across its axis, and with shift ten times as finely", async () => {
    const square = await gizmo("plane x");
    const ways = [];
    for (const keys of [[], ["Shift"]]) {
      // Pressed with the key, it would pan.
      await page.mouse.move(...square);
      await page.mouse.down();
      for (const key of keys) await page.keyboard.down(key);
      await page.mouse.move(square[0] + 40, square[1] - 30, { steps: 4 });
      const by = await values("by");
      check(by[0] === 0 && by[1] !== 0 && by[2] > 0, `the translation is ${by}`);
      ways.push(by);
      for (const key of keys) await page.keyboard.up(key);
      await page.keyboard.press("Escape");
      await page.mouse.up();
      await nothing();
    }
    const [coarse, fine] = ways;
    for (const axis of [1, 2]) check(Math.abs(coarse[axis] / fine[axis] - 10) < 1, `without shift it goes by ${coarse}, with it by ${fine}`);
  }],
  ["what breaks the surface is red while it is dragged", async () => {
    const red = [255, 64, 51];
    await page.click('[data-camera="corner"]');
    await drawn();
    const [from, to] = [await viewer.place(HANDLE), await viewer.place("downstream")];
    check(from && to, "the walls cannot be seen from the corner");
    const way = [to[0] - from[0], to[1] - from[1]];
    const arrow = await gizmo("arrow y");
    await drag(arrow, way.map((part) => 0.1 * part));
    await preview();
    check((await viewer.pixelsOf(red)) === 0, "a surface that is sound is red");
    // Beyond the outlet, which stays where it is: the wall between them folds. The pointer stays down.
    await page.mouse.move(arrow[0] + 2 * way[0], arrow[1] + 2 * way[1], { steps: 8 });
    await viewer.holds("the words about it", () => /^Preview: the surface would be broken/.test(document.getElementById("preview").textContent));
    await viewer.holds("the number at the cursor", () => !document.querySelector(".gizmo-value").hidden);
    const count = await viewer.pixelsOf(red);
    check(count > 20, `${count} pixels are red`);
    console.log(`    ${count} pixels`);
    await picture("broken");
    await page.keyboard.press("Escape");
    await page.mouse.up();
    await nothing();
    check((await viewer.pixelsOf(red)) === 0, "it stays red");
    await page.click('[data-camera="0"]');
  }],
  ["a vector has room for its numbers, and keeps all their digits", async () => {
    const by = page.locator('.object:not([hidden]) input[aria-label$="by y"]');
    for (const typed of ["0.02", "-0.02", "0.000023655"]) {
      await page.focus("#scene");
      for (const key of ["g", "y"]) await page.keyboard.press(key);
      await page.keyboard.type(typed);
      await page.keyboard.press("Enter");
      const [wide, room, text, hint] = await by.evaluate((input) => [input.scrollWidth, input.clientWidth, input.value, input.title]);
      check(wide <= room && text !== "", `of ${typed} "${text}" is ${wide} wide, there is room for ${room}`);
      check(Number(text) === Number(typed) || Number(hint) === Number(typed), `${typed} has become ${text}, "${hint}"`);
      const { largest } = await preview();
      check(Math.abs(largest / Math.abs(Number(typed)) - 1) < 0.1, `${typed} moves by up to ${largest}`);
    }
    await cancel();
  }],
  ["lasso, brush, rectangle and angle choose faces as the region", async () => {
    await page.click("#faces");
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
    await viewer.clean("with faces chosen");
    const small = await viewer.small();
    check(small.length === 0, `with faces chosen these are smaller than 24 px: ${small.join(", ")}`);
    // Taken back, the next tool begins with nothing.
    const taken = async (tool, stroke) => {
      await page.getByRole("button", { name: "Clear", exact: true }).click();
      await viewer.holds("no faces", () => document.querySelector(".face-tools output").textContent === "");
      await page.getByRole("button", { name: tool, exact: true }).click();
      await stroke();
      return viewer.holds(`faces by ${tool}`, () => Number.parseInt(document.querySelector(".face-tools output").textContent, 10));
    };
    const middle = await viewer.place(HANDLE);
    const brushed = await taken("Brush", () => drag(middle, [40, 0]).then(() => page.mouse.up()));
    const boxed = await taken("Rectangle", () => drag([cx - 70, cy - 90], [140, 180]).then(() => page.mouse.up()));
    const reached = await taken("By angle", () => page.mouse.click(...middle));
    check(brushed < boxed, `a brush takes ${brushed} faces, a rectangle ${boxed}`);
    // The same outline as the lasso's.
    check(Math.abs(boxed - count) < 0.05 * count, `a rectangle takes ${boxed} faces, a lasso ${count}`);
    // The wall that is looked at, from inlet to outlet, and nothing round its edges.
    check(reached > 2 * boxed, `${reached} faces are reached from one without a sharper edge, a rectangle has ${boxed}`);
    // What is begun is given up with Escape, and what was chosen stays.
    await page.getByRole("button", { name: "Lasso", exact: true }).click();
    await drag([cx - 70, cy - 90], [140, 180]);
    await page.keyboard.press("Escape");
    await page.mouse.up();
    check(Number.parseInt(await viewer.text(".face-tools output"), 10) === reached, "a lasso that was given up takes faces");
    await page.getByRole("button", { name: "As box", exact: true }).click();
    await viewer.holds("the box", () => [...document.querySelectorAll(".object:not([hidden]) select")].some(({ value, selectedOptions }) => value === "box" || selectedOptions[0]?.textContent === "box"));
    await page.keyboard.press("Escape");
    check(await page.isHidden(".face-tools"), "the tools stay");
    check((await page.evaluate(() => window.tombolo.selection.handle)).length === 0, "the feature is still the handle");
    await drag(await gizmo("arrow z"), [0, -20]);
    await page.mouse.up();
    check((await preview()).largest > 0, "the faces do not move");
    console.log(`    by lasso ${count} faces, by rectangle ${boxed}, by brush ${brushed}, by angle ${reached}`);
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
  ["a dragged node has the skeleton follow the preview, and another drag and another node come to it", async () => {
    const moves = () => page.locator('.object:not([hidden]) .entry').evaluateAll((entries) => entries.map((entry) => ["x", "y", "z"].map((axis) => entry.querySelector(`input[aria-label$=" by ${axis}"]`)?.value)).filter(([x]) => x !== undefined));
    const places = () => page.evaluate(() => window.tombolo.skeleton.places);
    const before = await places();
    // Neighbours, of one branch.
    const [first, between, second] = [1, 2, 3];
    await drag(before[first], [0, -30]);
    await preview();
    // The pointer is down still.
    await viewer.holds("the node beside it where the preview has it", ([i, y]) => window.tombolo.skeleton.places[i][1] < y - 3, [between, before[between][1]]);
    await page.mouse.up();
    const [one] = await moves();
    check((await moves()).length === 1, `one node was dragged: ${JSON.stringify(await moves())}`);
    await drawn();
    await drag((await places())[second], [0, 25]);
    await page.mouse.up();
    const two = await moves();
    check(two.length === 2 && JSON.stringify(two).includes(JSON.stringify(one)), `after a second node the drags are ${JSON.stringify(two)}, the first was ${JSON.stringify(one)}`);
    await picture("skeleton-follows");
    await cancel();
    // Several at once.
    await drawn();
    await page.mouse.click(...(await places())[first]);
    await page.keyboard.down("Shift");
    await page.mouse.click(...(await places())[second]);
    await page.keyboard.up("Shift");
    await drag((await places())[second], [0, -25]);
    await page.mouse.up();
    const both = await moves();
    check(both.length === 2 && JSON.stringify(both[0]) === JSON.stringify(both[1]), `two nodes that are dragged together go by ${JSON.stringify(both)}`);
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
