/** Under which name this viewer is known to the run: kept while the page is loaded again, and told to no other run of a relay. */
import type { Identity } from "./connection";

const CLIENT = `tombolo-client ${location.pathname}`, BACK = `tombolo-back ${location.pathname}`;

/** Who this viewer was before the page was loaded again; null where it was nobody. */
export function knownIdentity(): Identity | null {
  const [client, back] = [sessionStorage.getItem(CLIENT), sessionStorage.getItem(BACK)];
  return client !== null && back !== null ? { client, back } : null;
}

export function keepIdentity({ client, back }: Identity): void {
  sessionStorage.setItem(CLIENT, client);
  sessionStorage.setItem(BACK, back);
}
