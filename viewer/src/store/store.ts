/**
 * One place for what the page knows, with one way in: an action says what happened, the reducer makes the next state of it, and
 * whoever watches a part of the state is called once that part is another one.
 */
export class Store<S, A> {
  private readonly watchers = new Set<() => void>();
  private readonly waiting: A[] = [];
  private busy = false;

  /** `reduce` makes the next state; it changes nothing, and gives the same object back where nothing is different. */
  constructor(private current: S, private readonly reduce: (state: S, action: A) => S) {}

  get state(): S {
    return this.current;
  }

  /** Takes an action. One that a watcher dispatches waits until all have seen the state before it. */
  dispatch(action: A): void {
    this.waiting.push(action);
    if (this.busy) return;
    this.busy = true;
    try {
      for (let next = this.waiting.shift(); next !== undefined; next = this.waiting.shift()) {
        const before = this.current;
        this.current = this.reduce(before, next);
        if (this.current !== before) for (const watcher of [...this.watchers]) watcher();
      }
    } finally {
      this.busy = false;
      this.waiting.length = 0;
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

/** Whether two values are the same as JSON: for what a selector makes anew each time. */
export const sameJson = (a: unknown, b: unknown): boolean => Object.is(a, b) || JSON.stringify(a) === JSON.stringify(b);

/** Whether all parts of one list are those of the other: for a selector that takes several parts of the state. */
export const sameParts = (a: readonly unknown[], b: readonly unknown[]): boolean => a.length === b.length && a.every((part, i) => Object.is(part, b[i]));
