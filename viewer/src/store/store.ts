/**
 * One place for what the page knows, with one way in: an action says what happened, the reducer makes the next state of it, and
 * whoever watches a part of the state is called once that part is another one.
 */
export class Store<S, A> {
  private readonly watchers = new Set<() => void>();
  private readonly waiting: A[] = [];
  private busy = false;

  /**
   * `reduce` makes the next state; it changes nothing, and gives the same object back where nothing is different. `failed` is told of what a
   * watcher or `reduce` throws, which keeps nobody else from going on; where nobody is told, it is thrown in a task of its own.
   */
  constructor(
    private current: S, private readonly reduce: (state: S, action: A) => S,
    private readonly failed: (error: unknown) => void = (error) => { setTimeout(() => { throw error; }); },
  ) {}

  get state(): S {
    return this.current;
  }

  /** Takes an action. One that a watcher dispatches waits until all have seen the state before it. */
  dispatch(action: A): void {
    this.waiting.push(action);
    if (this.busy) return;
    this.busy = true;
    for (let next = this.waiting.shift(); next !== undefined; next = this.waiting.shift()) {
      const action = next;
      const before = this.current;
      this.attempt(() => { this.current = this.reduce(before, action); });
      if (this.current !== before) for (const watcher of [...this.watchers]) this.attempt(watcher);
    }
    this.busy = false;
  }

  private attempt(work: () => void): void {
    try {
      work();
    } catch (error) {
      this.failed(error);
    }
  }

  /** Calls `listener` with a part of the state: at once, and whenever it is another one. Gives back what ends that. */
  watch<T>(select: (state: S) => T, listener: (value: T) => void, same: (a: T, b: T) => boolean = Object.is): () => void {
    let seen = select(this.current);
    const watcher = (): void => {
      const value = select(this.current);
      if (same(value, seen)) return;
      seen = value;
      listener(value);
    };
    this.watchers.add(watcher);
    listener(seen);
    return () => { this.watchers.delete(watcher); };
  }
}

/** A selector that computes anew only where one of the parts of the state that it depends on is another one. */
export function derived<S, T>(parts: (state: S) => readonly unknown[], compute: (state: S) => T): (state: S) => T {
  let known: { parts: readonly unknown[]; value: T } | null = null;
  return (state) => {
    const now = parts(state);
    if (!known || now.length !== known.parts.length || now.some((part, i) => !Object.is(part, known!.parts[i]))) known = { parts: now, value: compute(state) };
    return known.value;
  };
}

/** Whether two values are the same as JSON: for what a selector makes anew each time. No text is made of lists whose parts are the same. */
export const sameJson = (a: unknown, b: unknown): boolean => isAlike(a, b) || JSON.stringify(a) === JSON.stringify(b);

/** Whether two values are one, or lists of such. */
const isAlike = (a: unknown, b: unknown): boolean =>
  Object.is(a, b) || (Array.isArray(a) && Array.isArray(b) && a.length === b.length && a.every((part, i) => isAlike(part, b[i])));

/** Whether all parts of one list are those of the other: for a selector that takes several parts of the state. */
export const sameParts = (a: readonly unknown[], b: readonly unknown[]): boolean => a.length === b.length && a.every((part, i) => Object.is(part, b[i]));
