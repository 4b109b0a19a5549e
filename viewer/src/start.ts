/**
 * Begins what takes its time elsewhere, while most of the page is still arriving: the connection, and the kernel that decodes its
 * frames. So this is small, and the page itself (`main`) is another file.
 */
import { streamAddress } from "./connection/connection";
import { knownIdentity } from "./connection/identity";
import { Stream } from "./connection/stream";
import { compileKernel } from "./kernel/kernel";

export const addresses = streamAddress(window.location.href);
/** The kernel decodes the frames and computes the previews: it is fetched once, at once. */
export const kernel = compileKernel();
const worker = new Worker(new URL("./connection/decode.worker.ts", import.meta.url), { type: "module" });
export const stream = new Stream(addresses, worker);
kernel.then((module) => worker.postMessage({ module }), (error: unknown) => stream.fail(error instanceof Error ? error.message : String(error)));
worker.addEventListener("error", (event) => stream.fail(event.message || "what decodes its frames could not be started"));
// A viewer that was here before comes back under its name.
stream.connection.identity = knownIdentity();
stream.connection.start();

void import("./main");
