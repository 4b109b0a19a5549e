/** Edits in a file: the order of a whole stack, as a file of orders holds it. */
import type { Json } from "../connection/protocol";
import { isObject, partsOf } from "../store/draft";

/** The largest file that is read, in bytes: what one message to the simulation may hold. */
export const LARGEST = 16 * 1024 * 1024;

export const writeEdits = (stack: readonly Json[]): string => `${JSON.stringify({ stack }, null, 2)}\n`;

/** The edits of a file: of `{"stack": [...]}`, `{"edits": [...]}`, an order around either, or a list alone. Says what is wrong where there are none. */
export function readEdits(text: string): { stack: Json[] } | { wrong: string } {
  let found: unknown;
  try {
    found = JSON.parse(text);
  } catch (error) {
    return { wrong: `it is not JSON: ${error instanceof Error ? error.message : String(error)}` };
  }
  const order = isObject(found) && isObject(found.order) ? found.order : found;
  const list = Array.isArray(order) ? order : isObject(order) ? order.stack ?? order.edits : undefined;
  if (!Array.isArray(list)) return { wrong: 'it has no list of edits, such as {"stack": [...]}' };
  const bad = list.findIndex((edit) => partsOf(edit as Json) === null || Object.keys(edit as object).length !== 1);
  return bad < 0 ? { stack: list as Json[] } : { wrong: `entry ${bad + 1} is no edit: an edit is an object with one key, such as {"translate": {...}}` };
}
