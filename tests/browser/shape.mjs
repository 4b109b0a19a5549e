/**
 * Changes the shape of a running nozzle as two people would, in Debian's Chromium, over a line that the run itself encrypts: whom the
 * browser talks to, what is safe at first, a refused order and each of its remedies, the page loaded again in mid-order, an earlier edit
 * changed, edits reordered, renamed and deleted, an order cancelled, taking back by keys, the wheel handed over, and the end of the run.
 *
 *     TOMBOLO_URL="https://127.0.0.1:7070/?token=...#sha256=..." TOMBOLO_PID=... node tests/browser/shape.mjs
 *
 * TOMBOLO_PID is the run's process, which is asked to stop at last; without it the run goes on. The other variables are those of page.mjs.
 */
import { createHash } from "node:crypto";
import { Failure, Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
// The certificate is one that nobody has signed.
const options = { ignoreHTTPSErrors: true };
const first = await Viewer.open(browser, "first", options);
let second = null;
const { page } = first;
const factor = (axis, value) => first.field(`factors ${axis}`).fill(String(value));
const told = () => first.until("the forecast", ({ forecast }) => {
  check(forecast.state !== "failed", `there is no forecast: ${forecast.reason}`);
  return forecast.state === "told";
});
/** Does what gives an order, and waits until that has come to its end. */
const given = async (act) => {
  const known = new Set((await first.look()).orders.map((order) => order.id));
  await act();
  return first.settled(known);
};
/** Has the run rest, or go on. */
const rests = async (paused) => {
  await page.click("#pause");
  await first.until(paused ? "the run paused" : "the run going on", (now) => now.status?.paused === paused);
};
/** Takes the only edit back. */
const takenBack = async () => {
  await first.until("an edit to take back", (now) => now.stack.length === 1);
  check((await given(() => page.click("#undo"))).status === "applied", "it cannot be taken back");
  await first.until("no edit", (now) => now.stack.length === 0);
};
/** Waits until the list of edits has these rows: the edits are fetched once the run has told of them. */
const listed = (...rows) => first.holds(`the list of ${rows.length} edits: ${rows.join("; ")}`, (wanted) =>
  JSON.stringify([...document.querySelectorAll("#stack .title")].map((title) => title.textContent)) === JSON.stringify(wanted), rows);
/** Whether all of an element is in the window and nothing lies over its middle. */
const inSight = (viewer, selector) => viewer.page.evaluate((wanted) => {
  const found = document.querySelector(wanted);
  const box = found.getBoundingClientRect();
  const hit = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
  return box.width > 0 && box.left >= 0 && box.top >= 0 && box.right <= innerWidth && box.bottom <= innerHeight && (found.contains(hit) || hit === found);
}, selector);

const steps = [
  ["the line is encrypted, by the certificate that the link names", async () => {
    const [socket] = await Promise.all([page.waitForEvent("websocket"), page.goto(link)]);
    check(socket.url().startsWith("wss://"), `the connection is to ${socket.url().split("?")[0]}`);
    const context = page.context();
    const debugging = await context.newCDPSession(page);
    let line = null;
    debugging.on("Security.visibleSecurityStateChanged", ({ visibleSecurityState }) => { line = visibleSecurityState.certificateSecurityState ?? line; });
    await debugging.send("Security.enable");
    await first.until("what the browser says of the line", () => line !== null);
    check(line.protocol === "TLS 1.3", `the page came by ${line.protocol}`);
    const fingerprint = createHash("sha256").update(line.certificate[0], "base64").digest("hex");
    check(link.endsWith(`#sha256=${fingerprint}`), `the browser sees the certificate ${fingerprint}`);
    const cookies = await context.cookies();
    check(cookies.length > 0 && cookies.every(({ secure, httpOnly }) => secure && httpOnly), "a cookie could go over a line that is not encrypted");
    check(!page.url().includes("token"), `the secret stays in ${page.url()}`);
  }],
  ["what flows in and out is held at first", async () => {
    const { selection, role } = await first.until("a first picture", (now) => now.connection === "connected" && now.frames > 0 && now.selection.fixed.length > 0);
    check(role === "driver", `the first viewer should steer, it is ${role}`);
    check(JSON.stringify(selection) === JSON.stringify({ handle: [], fixed: ["inlet", "outlet"] }), `at first ${JSON.stringify(selection)} is chosen`);
    check(await page.locator("#undo").isDisabled(), "Undo can be pressed though nothing was done");
    check(await page.locator("#apply").isDisabled() || (await page.locator("#preview").isHidden()), "something is asked for at first");
    first.whole = await first.extent("throat", 2);
  }],
  ["an open boundary does not move without a word", async () => {
    await page.selectOption("#action", "translate");
    await page.check('input[aria-label="outlet: handle"]');
    await first.field("by z").fill("0.04");
    // Until the first preview has come it says that nothing is known yet.
    const words = await first.holds("what would move", () => { const said = document.getElementById("open-moved"); return !said.hidden && / would move /.test(said.innerText) && said.innerText; });
    check(/outlet \(outflow\) would move by 0\.04/.test(words), `the page says "${words}"`);
    check((await first.text("#apply")) === "Apply anyway", `the button says "${await first.text("#apply")}"`);
    await first.picture("open-moved");
    await page.click("#cancel");
    check((await first.field("by z").inputValue()) === "0", "Cancel left a value in the form");
    await page.check('input[aria-label="outlet: fixed"]');
  }],
  ["a refusal turns Apply off, and each remedy helps", async () => {
    await page.selectOption("#action", "scale_direction");
    await page.check('input[aria-label="throat: handle"]');
    await factor("z", 0.01);
    const { forecast } = await told();
    check(forecast.outcome === "rejected" && forecast.fraction > 0, `the forecast is ${JSON.stringify(forecast)}`);
    check(await page.locator("#apply").isDisabled(), "Apply can be pressed though it would be refused");
    for (const selector of ["#preview", "#forecast", "#apply", "#cancel", "#apply-part"]) check(await inSight(first, selector), `${selector} is not in sight at 1280 x 800`);
    await page.click("#verdict-details summary");
    check(await inSight(first, "#apply"), "Apply is not in sight once the details are unfolded");
    await first.picture("refused");
    const before = await first.drawn();
    await page.click("#show-worst");
    check((await first.drawn()).pixels !== before.pixels, "the camera did not go to the worst cell");
    await first.picture("worst-cell");
    await page.click('[data-camera="reset"]');
    const offered = await first.text("#apply-part");
    check(/^Apply \d+(\.\d+)? %$/.test(offered), `the first button says "${offered}"`);
    await page.click("#apply-part");
    const filled = Number(await first.field("factors z").inputValue());
    check(Math.abs(1 - filled - 0.99 * forecast.fraction) < 0.002, `${offered} fills in ${filled}, ${forecast.fraction} would pass`);
    const again = await told();
    check(again.forecast.outcome === "applied" && !(await page.locator("#apply").isDisabled()), `after it the forecast is ${JSON.stringify(again.forecast)}`);
    // The slider stops at what passes.
    await page.locator("#amount").fill("100");
    check(Math.abs(Number(await first.field("factors z").inputValue()) - filled) < 0.011, `the slider went on to ${await first.field("factors z").inputValue()}`);
    await first.picture("filled-in");
    const passed = await given(() => page.click("#apply"));
    const asked = passed.order.edits[0].scale_direction.factors[2];
    check(passed.status === "applied" && Math.abs(asked - filled) < 1e-4 && passed.order.guard === undefined, `${offered} was ${passed.status}, with the factor ${asked}`);
    await first.until("the throat as low as would pass", async () => Math.abs((await first.extent("throat", 2)) / first.whole - asked) < 0.005);
    await takenBack();
    console.log(`    refused at 0.01: ${offered}, applied with ${asked}`);
  }],
  ["what can be untangled is applied untangled", async () => {
    await page.selectOption("#action", "rotate");
    await first.field("degrees").fill("120");
    check((await told()).forecast.outcome === "rejected", "half a turn and more passes as it is");
    await page.click("#untangle");
    const { forecast } = await told();
    check(forecast.outcome === "applied" && forecast.inverted === 0, `untangled it is ${JSON.stringify(forecast)}`);
    check(await page.locator("#untangle").isHidden(), "Untangle is offered again");
    const order = await given(() => page.click("#apply"));
    check(order.status === "applied" && order.order.guard.otherwise === "untangle", `the order ${JSON.stringify(order.order)} was ${order.status}: ${order.reason}`);
    check(Math.abs(order.min_scaled_jacobian - forecast.min) < 1e-3, `a quality of ${forecast.min} was foretold, it is ${order.min_scaled_jacobian}`);
    await first.picture("untangled");
    await takenBack();
  }],
  ["an order that the run refuses says so in its row, and changes nothing", async () => {
    await page.selectOption("#action", "scale_direction");
    // Before anything could have been foretold.
    const order = await given(() => page.evaluate(() => {
      const field = document.querySelector('.object:not([hidden]) input[aria-label="factors z"]');
      field.value = "0.01";
      field.dispatchEvent(new Event("input", { bubbles: true }));
      document.getElementById("apply").click();
    }));
    check(order.status === "rejected" && order.fraction > 0.9, `the order was ${order.status}`);
    await first.holds("the row of the refused order", (id) => {
      const row = document.querySelector(`#pending [data-order="${id}"]`);
      return row?.dataset.status === "rejected" && row.querySelector(".chip").textContent === "refused" && /would fall under the scaled Jacobian of|would be turned inside out/.test(row.querySelector(".detail").textContent);
    }, order.id);
    await first.picture("refused-by-the-run");
    check(Math.abs((await first.extent("throat", 2)) / first.whole - 1) < 0.005 && (await first.look()).stack.length === 0, "a refused order has changed the shape");
    check((await first.field("factors z").inputValue()) === "1", "the form still asks for what was refused");
    // Back into the form: all of it, and as much as would pass.
    await page.click(`#pending [data-order="${order.id}"] [data-act="again"]`);
    check((await first.field("factors z").inputValue()) === "0.01", "the form has not what was refused");
    check((await told()).forecast.outcome === "rejected", "what was refused is foretold to pass");
    await page.click("#cancel");
    const way = page.locator(`#pending [data-order="${order.id}"] [data-act="part"]`);
    const offered = await way.innerText();
    check(/^Apply 9\d %$/.test(offered), `the row offers "${offered}"`);
    await way.click();
    await told();
    const part = await given(() => page.click("#apply"));
    const asked = part.order.edits[0].scale_direction.factors[2];
    check(part.status === "applied" && Math.abs(1 - asked - 0.99 * order.fraction) < 0.002, `${offered} was ${part.status}, with the factor ${asked}`);
    await takenBack();
    await page.click(`#pending [data-order="${order.id}"] [aria-label^="Dismiss"]`);
    await first.holds("the row gone", () => document.querySelectorAll("#pending li").length === 0);
  }],
  ["an edit is applied once, however often Apply is pressed", async () => {
    await factor("z", 0.7);
    await told();
    const known = new Set((await first.look()).orders.map((order) => order.id));
    await page.locator("#apply").dblclick();
    const order = await first.settled(known);
    check(order.status === "applied", `the pinch was refused: ${order.reason}`);
    check((await first.look()).orders.filter(({ id }) => !known.has(id)).length === 1, "two orders were given");
    await listed("Throat: height × 0.7");
    await first.until("the pinch in the picture", async () => Math.abs((await first.extent("throat", 2)) / first.whole - 0.7) < 0.005);
    await first.picture("applied");
  }],
  ["an order is not lost when the page is loaded again, planned or on its way", async () => {
    await first.until("the pinch", (now) => now.stack.length === 1);
    const client = await page.evaluate(() => window.tombolo.client);
    const known = new Set((await first.look()).orders.map((order) => order.id));
    const own = ({ orders }) => orders.filter(({ id }) => !known.has(id));
    /** Loads the page again while the run rests: whoever steered steers, and the row of the order says how it stands. */
    const again = async (said) => {
      await page.reload();
      const seen = await first.until("the page again", (now) => now.connection === "connected" && now.frames > 0 && now.status?.paused === true && now.orders.length > known.size);
      check(seen.role === "driver" && (await page.evaluate(() => window.tombolo.client)) === client, `the page that was loaded again is a ${seen.role}`);
      check(own(seen).length === 1, `after it there are the orders ${JSON.stringify(own(seen))}`);
      const [{ id }] = own(seen);
      // Both at one moment, for the order goes on as it is planned.
      const { status, rows } = await page.evaluate((wanted) => ({
        status: window.tombolo.orders.find((order) => order.id === wanted).status,
        rows: [...document.querySelectorAll(`#pending [data-order="${wanted}"]`)].map((row) => ({ status: row.dataset.status, text: row.innerText })),
      }), id);
      check(rows.length === 1 && rows[0].status === status && said.test(rows[0].text), `the order is ${status}, its rows say ${JSON.stringify(rows)}`);
      return page.locator(`#pending [data-order="${id}"]`);
    };
    await rests(true);
    await page.selectOption("#action", "translate");
    await first.field("by y").fill("0.02");
    await first.scheduled(20, 100);
    await told();
    await page.click("#apply");
    await first.until("the order planned", (now) => own(now).some(({ status }) => status === "accepted" || status === "computing"));
    await again(/Throat: moved by 0\.02 along y[^]*(waiting|computing)/);
    await first.picture("planned");
    await rests(false);
    await first.until("the first shapes", (now) => own(now).some(({ status, shape }) => status === "applying" && shape >= 1));
    await rests(true);
    const row = await again(/Throat: moved by 0\.02 along y[^]*shape \d+ of 20/);
    const part = await row.locator(".bar div").evaluate((bar) => bar.getBoundingClientRect().width / bar.parentElement.getBoundingClientRect().width);
    check(part > 0 && part < 1, `the bar is filled to ${part}`);
    await first.picture("on-its-way");
    await rests(false);
    const seen = await first.until("the order applied", (now) => own(now).every(({ status }) => status === "applied"));
    check(own(seen).length === 1 && seen.stack.length === 2, `there are the orders ${JSON.stringify(own(seen))} and the edits ${JSON.stringify(seen.stack)}`);
    await listed("Throat: height × 0.7", "Throat: moved by 0.02 along y");
    check((await given(() => page.click("#undo"))).status === "applied", "it cannot be taken back");
    await first.until("the pinch alone", (now) => now.stack.length === 1);
    await first.scheduled(2, 1);
  }],
  ["the first of two edits is changed, and the second follows", async () => {
    await page.selectOption("#action", "translate");
    await first.field("by z").fill("0.01");
    await told();
    check((await first.apply()).status === "applied", "the second edit was refused");
    await first.until("both edits", (now) => now.stack.length === 2);
    await page.click('#stack [data-edit="0"] [data-act="load"]');
    check((await first.field("factors z").inputValue()) === "0.7", "the first edit's values are not in the form");
    check((await first.text("#apply")) === "Update edit 1", `the button says "${await first.text("#apply")}"`);
    await factor("z", 0.9);
    await told();
    await first.picture("update");
    check((await first.apply()).status === "applied", "the change was refused");
    await listed("Throat: height × 0.9", "Throat: moved by 0.01 along z");
    await first.until("the throat as changed", async () => Math.abs((await first.extent("throat", 2)) / first.whole - 0.9) < 0.005);
  }],
  ["edits are dragged into another order, renamed and deleted", async () => {
    const [pinch, way] = ["Throat: height × 0.9", "Throat: moved by 0.01 along z"];
    const row = (index, act) => `#stack [data-edit="${index}"] ${act}`;
    const applied = async (what, act) => check((await given(act)).status === "applied", `${what} was refused`);
    await applied("the other order", () => page.dragAndDrop(row(1, ".grip"), row(0, ".grip")));
    await listed(way, pinch);
    await first.picture("reordered");
    await applied("the order of before", () => page.dragAndDrop(row(0, ".grip"), row(1, ".grip")));
    await listed(pinch, way);
    await page.click(row(0, '[data-act="rename"]'));
    await page.keyboard.type("Narrow");
    await applied("the name", () => page.keyboard.press("Enter"));
    await listed("Narrow", way);
    check((await first.look()).stack[0].scale_direction.name === "Narrow", "the run has not the name");
    await applied("what is left", () => page.click(row(0, '[data-act="remove"]')));
    await listed(way);
    await first.until("the throat without what was deleted", async () => Math.abs((await first.extent("throat", 2)) / first.whole - 1) < 0.005);
    await applied("the edit brought back", () => page.click("#undo"));
    await listed("Narrow", way);
  }],
  ["an order that waits is cancelled, and nothing comes of it", async () => {
    const { stack } = await first.look();
    await rests(true);
    await page.selectOption("#action", "translate");
    await first.field("by y").fill("0.02");
    const order = await given(async () => {
      await page.click("#apply");
      await page.click("#pending button.cancel");
    });
    check(order.status === "rejected" && /cancel/.test(order.reason), `the order is ${order.status}: ${order.reason}`);
    const row = await first.text(`#pending [data-order="${order.id}"]`);
    check(/cancelled/.test(row) && /by you/.test(row) && !/refused/.test(row), `the row of the cancelled order says "${row}"`);
    await first.picture("cancelled");
    await rests(false);
    const { cycle } = (await first.look()).status;
    await first.until("later cycles", (now) => now.status.cycle > cycle + 20);
    check(JSON.stringify((await first.look()).stack) === JSON.stringify(stack), "a cancelled order has left an edit");
  }],
  ["muting keeps the focus, and keys take back and bring back, before Apply and after", async () => {
    const known = () => first.look().then((now) => new Set(now.orders.map((order) => order.id)));
    let before = await known();
    await page.focus('#stack [data-edit="1"] [data-act="mute"]');
    await page.keyboard.press("Enter");
    await first.settled(before);
    await page.waitForFunction(() => document.querySelector('#stack [data-edit="1"]')?.dataset.muted === "true");
    check(await page.evaluate(() => document.activeElement?.dataset.act === "mute"), "the focus is lost after Mute");
    // Before Apply.
    await page.selectOption("#action", "scale_direction");
    await factor("z", 0.8);
    await page.keyboard.press("Control+z");
    check((await first.field("factors z").inputValue()) === "1", `Ctrl+Z left ${await first.field("factors z").inputValue()} in the form`);
    await page.keyboard.press("Control+Shift+z");
    check((await first.field("factors z").inputValue()) === "0.8", "Ctrl+Shift+Z did not bring the value back");
    await page.click("#cancel");
    // After it.
    const stack = JSON.stringify((await first.look()).stack);
    before = await known();
    await page.focus("#scene");
    await page.keyboard.press("Control+z");
    await first.settled(before);
    await page.waitForFunction(() => document.querySelector('#stack [data-edit="1"]')?.dataset.muted === "false");
    before = await known();
    await page.keyboard.press("Control+Shift+z");
    await first.settled(before);
    await first.until("the stack of before", (now) => JSON.stringify(now.stack) === stack);
  }],
  ["the keyboard reaches Apply, and applies", async () => {
    await page.selectOption("#action", "scale_direction");
    await factor("z", 0.95);
    await told();
    await page.focus("#pause");
    await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
    check(await page.evaluate(() => document.activeElement?.id) === "apply", "two keys from Pause are not at Apply");
    const known = new Set((await first.look()).orders.map((order) => order.id));
    await page.keyboard.press("Control+Enter");
    check((await first.settled(known)).status === "applied", "Ctrl+Enter did not apply");
  }],
  ["the wheel is asked for, kept, and handed over", async () => {
    second = await Viewer.open(browser, "second", { viewport: { width: 1920, height: 1080 }, ...options });
    await second.page.goto(link);
    const seen = await second.until("a picture", (now) => now.connection === "connected" && now.frames > 0);
    check(seen.role === "watcher", `the second viewer is ${seen.role}`);
    for (const selector of ["#apply", "#undo", "#pause"]) check(await second.page.locator(selector).isDisabled(), `a watcher can press ${selector}`);
    check(/ask to steer/.test(await second.page.getAttribute("#pause", "title")), "the reason is not said");
    // So that the driver is not taken for gone, however long the second page took.
    await page.mouse.move(5, 5);
    await second.page.click("#wheel");
    await page.waitForFunction(() => !document.getElementById("asked").hidden);
    await first.picture("asked");
    check(await inSight(first, "#hand-over"), "Hand over is not in sight");
    await page.click("#keep");
    await second.page.waitForFunction(() => document.getElementById("waiting").textContent.endsWith("keeps the wheel."));
    await second.page.click("#wheel");
    await page.waitForFunction(() => !document.getElementById("asked").hidden);
    await page.click("#hand-over");
    await second.until("the wheel", (now) => now.role === "driver");
    await first.until("watching", (now) => now.role === "watcher");
    check(!(await second.page.locator("#pause").isDisabled()), "the one who steers cannot pause");
    check(await second.page.locator("#refusal").isHidden(), `a refusal stays: ${await second.page.locator("#refusal").textContent()}`);
    check(await page.locator("#pause").isDisabled(), "the one who watches can pause");
    await second.picture("steers");
  }],
  ["it all fits, whatever the window", async () => {
    for (const [width, height] of [[1280, 800], [1920, 1080], [820, 1180]]) {
      await second.page.setViewportSize({ width, height });
      await second.page.waitForTimeout(300);
      await second.picture(`${width}x${height}`);
      const small = await second.small();
      check(small.length === 0, `at ${width} x ${height} these are smaller than 24 px: ${small.join(", ")}`);
    }
  }],
  ["the end of the run is said, and nothing more is offered", async () => {
    if (!process.env.TOMBOLO_PID) return;
    process.kill(Number(process.env.TOMBOLO_PID), "SIGTERM");
    for (const viewer of [first, second]) {
      const { end } = await viewer.until("the end", (now) => now.end !== null);
      check(end.how === "stopped", `the run ended as ${end.how}`);
      const words = await viewer.text("#banner");
      check(words.startsWith(`The run ended at cycle ${end.cycle}: stopped.`) && !/[Tt]rying/.test(words), `the banner says "${words}"`);
      check(/^ended: stopped$/.test(await viewer.text("#run")), `the run is "${await viewer.text("#run")}"`);
      check((await viewer.drawn()).cycle !== null, "the picture is gone");
      // A page that tries again does so within a third of a second.
      await viewer.page.waitForTimeout(1500);
      check((await viewer.look()).connection === "ended", "the page tries again");
      for (const selector of ["#apply", "#undo", "#pause"]) check(await viewer.page.locator(selector).isDisabled(), `${selector} can be pressed after the end`);
      await viewer.picture("ended");
    }
  }],
  ["nothing went wrong on the way", async () => {
    const complaints = [first, second].flatMap((viewer) => viewer?.complaints ?? []);
    if (complaints.length > 0) throw new Failure(complaints.join("\n"));
  }],
];

await run(steps, () => [first, second].filter(Boolean), () => browser.close());
