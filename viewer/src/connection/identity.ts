/** Under which name this viewer is known to the run: kept while the page is loaded again, and told to no other run of a relay. */
import { writeForRun } from "../store/session";
import type { Identity } from "./connection";

const CLIENT = `tombolo-client ${location.pathname}`, BACK = `tombolo-back ${location.pathname}`;

/** Who this viewer was before the page was loaded again; null where it was nobody. */
export function knownIdentity(): Identity | null {
  const [client, back] = [sessionStorage.getItem(CLIENT), sessionStorage.getItem(BACK)];
  return client !== null && back !== null ? { client, back } : null;
}

export function keepIdentity({ client, back }: Identity): void {
  if (writeForRun(sessionStorage, location.pathname, { [CLIENT]: client, [BACK]: back })) return;
  // Half of it, or that of before, would be another viewer's.
  for (const key of [CLIENT, BACK]) sessionStorage.removeItem(key);
}
