/**
 * The viewer in a page of others, as a notebook is, in Debian's Chromium: it is there, with its picture and its commands, in the page that
 * the run names, and in no other.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... TOMBOLO_PAGES="8888 8889" node tests/browser/framing.mjs
 *
 * TOMBOLO_PAGES  the port of the page that the run names, `http://localhost:PORT`, and that of another
 * The other variables are those of page.mjs.
 */
import { createServer } from "node:http";
import { Viewer, check, launch, link, patience, run } from "./page.mjs";

const [named, other] = (process.env.TOMBOLO_PAGES ?? "").split(" ").map(Number);
// A browser sends the cookie along where the two have one name: ports do not count.
const framed = link.replace("127.0.0.1", "localhost");
const page = `<!doctype html><title>Notebook</title><iframe src="${framed}" width="1200" height="700" allow="fullscreen; clipboard-write"></iframe>`;
const servers = [named, other].map((port) => createServer((_, answer) => answer.setHeader("content-type", "text/html").end(page)).listen(port, "localhost"));

const browser = await launch();
const viewer = await Viewer.open(browser, "framing");
const inside = () => viewer.page.frames().find((frame) => frame !== viewer.page.mainFrame());
const steps = [
  ["the page that the run names shows the viewer", async () => {
    await viewer.page.goto(`http://localhost:${named}/`);
    const frame = inside();
    await frame.waitForFunction(() => window.tombolo?.frames > 0, undefined, { timeout: patience, polling: 100 });
    check(!frame.url().includes("token="), `the token stays in ${frame.url()}`);
    await viewer.picture("named");
  }],
  ["it steers from there", async () => {
    const frame = inside();
    await frame.locator("#pause").click();
    await frame.waitForFunction(() => window.tombolo.status?.paused === true, undefined, { timeout: patience, polling: 100 });
    await frame.locator("#pause").click();
    await frame.waitForFunction(() => window.tombolo.status?.paused === false, undefined, { timeout: patience, polling: 100 });
    check(viewer.complaints.length === 0, viewer.complaints.join("\n"));
  }],
  ["another page does not", async () => {
    const refused = viewer.page.waitForEvent("console", { predicate: (message) => message.text().includes("frame-ancestors"), timeout: patience });
    await viewer.page.goto(`http://localhost:${other}/`);
    await refused;
    const seen = await inside()?.evaluate(() => "tombolo" in window).catch(() => false);
    check(seen !== true, "the viewer is in a page that the run does not name");
    await viewer.picture("other");
  }],
];
await run(steps, () => [viewer], async () => {
  servers.forEach((server) => server.close());
  await browser.close();
});
