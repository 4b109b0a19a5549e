/**
 * What a page says where something is amiss: a browser that cannot draw, graphics that are taken away, a link that is too slow, a lost
 * connection, a browser that is not known any more, an older run, a run that has failed. Steps of seeing.mjs, on its run.
 */
import { Viewer, check, launch, link } from "./page.mjs";

/** A page whose messages from the run go through here: `line` holds frames back, cuts the connection, and says what else comes. */
async function behindALine(browser) {
  const viewer = await Viewer.open(browser, "line");
  const line = { holdsFrames: false, held: [], rewrite: (text) => text, send: null, cut: null };
  await viewer.page.routeWebSocket(/\/ws(\?|$)/, (socket) => {
    const run = socket.connectToServer();
    line.send = (message) => socket.send(message);
    line.cut = () => Promise.all([socket.close({ code: 1011, reason: "cut" }), run.close()]);
    socket.onMessage((message) => run.send(message));
    run.onMessage((message) => {
      if (typeof message === "string") socket.send(line.rewrite(message));
      else if (line.holdsFrames) line.held.push(message);
      else socket.send(message);
    });
  });
  return { viewer, line };
}

/** Waits until an element of the page says this. */
const says = (viewer, selector, words) => viewer.holds(`${selector} with ${words}`, ([where, wanted]) => {
  const found = document.querySelector(where);
  return found.checkVisibility() && new RegExp(wanted).test(found.innerText) && found.innerText;
}, [selector, words.source]);

/** The steps, for the page of `viewer`, which draws the run of the link. */
export const troubles = (browser, viewer) => {
  const shared = {};
  return [
    ["graphics that are taken away are missed in words, and what comes back is drawn again", async () => {
      const YELLOW = [253, 231, 37];
      check((await viewer.pixelsOf(YELLOW)) > 0, "the fastest flow is not yellow");
      await viewer.page.evaluate(() => {
        window.graphics = document.querySelector("#scene canvas").getContext("webgl2").getExtension("WEBGL_lose_context");
        window.graphics.loseContext();
      });
      await says(viewer, "#empty", /^The picture is gone\s+The browser has taken away what draws it/);
      await viewer.clean("without graphics");
      await viewer.page.evaluate(() => window.graphics.restoreContext());
      await viewer.holds("the picture again", () => document.getElementById("empty").hidden);
      await viewer.until("the flow in it", async () => (await viewer.pixelsOf(YELLOW)) > 0);
    }],
    ["a browser that cannot draw says so", async () => {
      const blind = await launch("--disable-3d-apis");
      try {
        const other = await Viewer.open(blind, "blind");
        await other.page.goto(link);
        await says(other, "#empty", /^This browser cannot draw the picture\s+It has no WebGL 2, or it is switched off\./);
        await other.clean("without WebGL");
        await other.picture("no-webgl");
      } finally {
        await blind.close();
      }
    }],
    ["a link that is too slow is named, with how old the picture is", async () => {
      const { viewer: other, line } = await behindALine(browser);
      Object.assign(shared, { other, line });
      await other.page.goto(link);
      await other.until("some frames", (now) => now.frames > 8);
      line.holdsFrames = true;
      const words = await says(other, "#silence", /^The picture is behind: \d+ s old, \d+ cycles/);
      await other.clean("behind");
      await other.picture("slow");
      line.holdsFrames = false;
      for (const frame of line.held.splice(0)) line.send(frame);
      await other.holds("the words gone", () => document.getElementById("silence").hidden);
      console.log(`    ${words}`);
    }],
    ["a lost connection is said, with what is not known; an older run that answers then is named as older", async () => {
      const { other, line } = shared;
      // Nothing is found again before axe has looked.
      await other.page.context().setOffline(true);
      await line.cut();
      await says(other, "#banner", /Whether the run goes on is unknown\. Trying again\./);
      check((await other.text("#run")) === "unknown", `the run is "${await other.text("#run")}"`);
      await other.clean("reconnecting");
      line.rewrite = (text) => (text.startsWith('{"hello"') ? JSON.stringify({ hello: { ...JSON.parse(text).hello, protocol: 1 } }) : text);
      await other.page.context().setOffline(false);
      const words = /^This page and the simulation do not understand each other: the simulation speaks protocol 1, this page \d+\. The simulation is older than this page: open the page that it serves itself\./;
      await says(other, "#banner", words);
      await other.picture("older");
      line.rewrite = (text) => text;
      await other.page.click("#retry");
      await other.until("the connection", (now) => now.connection === "connected");
      await other.holds("no banner", () => document.getElementById("banner").hidden);
    }],
    ["a browser that the run does not know any more is told what to do", async () => {
      const { other, line } = shared;
      await other.page.context().clearCookies();
      await line.cut();
      await says(other, "#banner", /^The simulation does not know this browser, or another one runs here now\. Open a link that the simulation told when it started\./);
      await other.clean("refused");
      await other.picture("refused");
    }],
    ["a run that has failed is said to have failed", async () => {
      const { other, line } = shared;
      await other.page.goto(link);
      await other.until("a picture", (now) => now.connection === "connected" && now.frames > 0);
      line.send(JSON.stringify({ end: { how: "failed", cycle: 4711, time: 4.711 } }));
      await says(other, "#banner", /^The run ended at cycle 4711: failed\. The picture stays as it was\.$/);
      check((await other.text("#run")) === "ended: failed", `the run is "${await other.text("#run")}"`);
      for (const selector of ["#apply", "#undo", "#pause"]) check(await other.page.locator(selector).isDisabled(), `${selector} can be pressed after the end`);
      // A page that was not let in asks why with an ordinary request, which is no way in: 400.
      const complaints = other.complaints.filter((text) => !/status of 400/.test(text));
      check(complaints.length === 0, complaints.join("\n"));
      await other.page.context().close();
    }],
  ];
};
