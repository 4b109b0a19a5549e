/**
 * What can wait for the first picture: it is done once that is drawn, or after a while where none comes. Each piece of work is a task of
 * its own, so that the page answers in between.
 */
export class Later {
  private waiting: (() => void)[] | null = [];

  /** `patience` is how long to wait for `begin` at most, in milliseconds. */
  constructor(patience: number) {
    setTimeout(() => this.begin(), patience);
  }

  run(work: () => void): void {
    if (this.waiting) this.waiting.push(work);
    else work();
  }

  begin(): void {
    for (const work of this.waiting ?? []) setTimeout(work, 0);
    this.waiting = null;
  }
}
