/**
 * Debian's Chromium, whose WebGL a processor draws: for the tests in a browser and for benchmarks/browser. It knows nothing of a run.
 * Needs the packages of viewer/ (`npm ci` there).
 *
 * CHROMIUM  the browser (default /usr/bin/chromium)
 */
import { createRequire } from "node:module";

const { chromium } = createRequire(new URL("../../viewer/package.json", import.meta.url))("playwright-core");

/** The browser; `more` are further switches of it. */
export const launch = (...more) => chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", ...more],
});
