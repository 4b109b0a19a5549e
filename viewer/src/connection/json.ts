/** JSON from the run's own address, never from the browser's store. */
import type { Json } from "./protocol";

export async function loadJson(address: string): Promise<Json> {
  const response = await fetch(address, { cache: "no-store", redirect: "error" });
  if (!response.ok) throw new Error(response.statusText);
  return await response.json() as Json;
}
