/** The storage of a page's session: what is kept of each run of a relay that was seen in it lies there side by side. */
export type SessionStore = Pick<Storage, "getItem" | "setItem" | "removeItem" | "key" | "length">;

/** How the key begins under which a page keeps what it has of a run while it is loaded again: the path of the run follows. */
export const RUN = "tombolo-run ";

/** Writes entries of the run at `path`, and returns whether all of them are there. Where there is no room, what is kept of other runs makes some. */
export function writeForRun(storage: SessionStore, path: string, entries: Readonly<Record<string, string>>): boolean {
  const isWritten = (): boolean => {
    try {
      for (const [key, text] of Object.entries(entries)) storage.setItem(key, text);
      return true;
    } catch {
      // A browser that keeps nothing, or is full: the page works all the same.
      return false;
    }
  };
  if (isWritten()) return true;
  const keys = Array.from({ length: storage.length }, (_, i) => storage.key(i) ?? "");
  for (const key of keys) if (key.startsWith(RUN) && key !== RUN + path) storage.removeItem(key);
  return isWritten();
}
