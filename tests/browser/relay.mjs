/**
 * Reaches runs through a relay behind a proxy under a path, in Debian's Chromium: the list of runs, an order, undo, reload, half a
 * minute without a network, and another run beside it.
 *
 *     TOMBOLO_URL=https://localhost:7443/tombolo/nozzle/?token=... TOMBOLO_OTHER=... TOMBOLO_PAGE=https://localhost:7443/tombolo/?token=... \
 *         TOMBOLO_NETWORK="7443 8443" node tests/browser/relay.mjs
 *
 * TOMBOLO_OTHER is the link of another run, TOMBOLO_PAGE that of the relay's page. TOMBOLO_NETWORK are the port of these links and the
 * one where the proxy listens: what is between them is cut. The other variables are those of page.mjs.
 */
import { Network } from "./network.mjs";
import { Viewer, check, launch, link, run } from "./page.mjs";

/** How long the network is away, in milliseconds. */
const AWAY = 30_000;

const [near, far] = process.env.TOMBOLO_NETWORK.split(" ").map(Number);
const network = await Network.open(near, far);
const browser = await launch();
// The certificate is one that nobody has signed.
const options = { ignoreHTTPSErrors: true };
const lister = await Viewer.open(browser, "list", options);
const viewer = await Viewer.open(browser, "viewer", options);
const { page } = viewer;
const names = () => lister.page.locator("td:first-child").allInnerTexts();
const pinch = async (factor) => {
  await page.selectOption("#action", "scale_direction");
  await page.check('input[aria-label="throat: handle"]');
  await viewer.field("factors z").fill(String(factor));
  await viewer.until("the forecast", ({ forecast }) => forecast.state === "told");
  const order = await viewer.apply();
  check(order.status === "applied", `the pinch was refused: ${order.reason}`);
};
let who = null;

const steps = [
  ["the page of the relay lists its runs", async () => {
    await lister.page.goto(process.env.TOMBOLO_PAGE);
    // A run may have come since the page was made, which looks again every few seconds.
    await lister.holds("its three runs", () => [...document.querySelectorAll("td:first-child")].map((it) => it.innerText).join() === "nozzle,pump,wing");
    check(!lister.page.url().includes("token"), `the secret stays in ${lister.page.url()}`);
    await lister.clean("the list");
    await lister.picture("runs");
  }],
  ["a run is steered through the relay: an order, and undo", async () => {
    await page.goto(link);
    await viewer.until("a first picture", (now) => now.connection === "connected" && now.frames > 0 && now.role === "driver");
    check(page.url().endsWith("/tombolo/nozzle/"), `the page is at ${page.url()}`);
    await pinch(0.8);
    await viewer.picture("pinched");
    await page.click("#undo");
    await viewer.until("the shape of before", ({ stack }) => stack.length === 0);
  }],
  ["it is the same viewer after a reload", async () => {
    who = await page.evaluate(() => window.tombolo.client);
    await page.reload();
    await viewer.until("a picture again", (now) => now.connection === "connected" && now.frames > 0 && now.role === "driver");
    const again = await page.evaluate(() => window.tombolo.client);
    check(who !== null && again === who, `${who} came back as ${again}`);
  }],
  ["half a minute without a network is noticed, said, and got over", async () => {
    const { cycle } = await viewer.look();
    network.cut();
    const begun = Date.now();
    await viewer.until("that nothing is heard", (now) => now.connection === "reconnecting");
    const noticed = Date.now() - begun;
    check(noticed > 15_000, `the network was cut, and the connection with it, in ${noticed} ms`);
    check(/unknown/.test(await viewer.text("#banner-text")), `the page says "${await viewer.text("#banner-text")}"`);
    const isSeen = await page.evaluate(() => {
      const box = document.getElementById("banner-text").getBoundingClientRect();
      return document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2)?.closest("#banner") !== null;
    });
    check(isSeen, "something lies over what the page says of the connection");
    check(await page.locator("#pause").isDisabled(), "an order could be given to a run that is not reached");
    await viewer.picture("without-network");
    await page.waitForTimeout(Math.max(0, AWAY - noticed));
    network.mend();
    const back = await viewer.until("the run again", (now) => now.connection === "connected" && now.role === "driver");
    check((await page.evaluate(() => window.tombolo.client)) === who, "another came back");
    await viewer.until("newer pictures", (now) => now.frames > back.frames && now.cycle > cycle);
    await pinch(0.9);
  }],
  ["another run beside it has viewers of its own", async () => {
    const other = await Viewer.open(browser, "other", options);
    await other.page.goto(process.env.TOMBOLO_OTHER);
    await other.until("a first picture", (now) => now.connection === "connected" && now.frames > 0 && now.role === "driver");
    check((await other.look()).stack.length === 0, "the edit of another run is in its list");
    await other.page.close();
    // The same tab on another run: neither takes the other's name for its own.
    await page.goto(process.env.TOMBOLO_OTHER);
    await viewer.until("the other run", (now) => now.connection === "connected" && now.frames > 0);
    await page.goto(link.split("?")[0]);
    await viewer.until("the first run again", (now) => now.connection === "connected" && now.role === "driver" && now.stack.length === 1);
    check((await page.evaluate(() => window.tombolo.client)) === who, "it is not known there any more");
  }],
  ["a run that ends leaves the list by itself", async () => {
    process.kill(Number(process.env.TOMBOLO_PID), "SIGTERM");
    await lister.holds("a list of two", () => document.querySelectorAll("td:first-child").length === 2);
    check((await names()).join() === "pump,wing", `it lists ${await names()}`);
  }],
  ["no page has complained", async () => {
    const complaints = [lister, viewer].flatMap(({ complaints }) => complaints);
    check(complaints.length === 0, complaints.join("; "));
  }],
];

await run(steps, () => [lister, viewer], async () => {
  await browser.close();
  network.close();
});
