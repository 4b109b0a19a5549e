/** What keys and fingers ask of a plot over one axis: another part of the axis, or the cursor elsewhere. */

/** A part of an axis, from its lower end to its upper one. */
export type Span = readonly [number, number];

/** The least part of the whole axis that is shown. */
const FINEST = 1e-3;
/** What one key makes of the part that is shown. */
const CLOSER = 0.5;
/** So many steps are one with shift. */
const LEAP = 10;
/** How near to the line of the cursor a finger means it, and how far one slips that taps; in pixels. */
const REACH = 10;
const SLIP = 8;

export interface Controlled {
  /** Shows so many times as much around the cursor. */
  zoomBy(factor: number): void;
  whole(): void;
  /** Moves the cursor by so many values; infinitely many are the first or the last. */
  step(by: number): void;
  /** Where keys or a finger have put the cursor, from 0 to 1 across the plot where that is seen; null where they have not. */
  cursor(): number | null;
  /** Takes that cursor away. */
  release(): void;
  /** Puts the cursor at a place, of 0 to 1 across the plot. */
  point(at: number): void;
  /** Two fingers have gone from places to others, all of 0 to 1, since both were down. */
  pinch(from: Span, to: Span): void;
  /** The second finger is down. */
  pinchBegun(): void;
}

/** A span of another size around a place that stays where it is seen. */
export function zoomed([low, high]: Span, at: number, factor: number): Span {
  return [at - (at - low) * factor, at + (high - at) * factor];
}

/** The span in which what was seen at two places is seen at two others; places are of 0 to 1 across it. */
export function pinched([low, high]: Span, from: Span, to: Span): Span {
  const [a, b] = from.map((place) => low + place * (high - low)) as [number, number];
  const apart = to[1] - to[0];
  // Fingers that meet or change sides ask for nothing that can be shown.
  if (apart * (from[1] - from[0]) <= 0) return [low, high];
  const size = (b - a) / apart;
  return [a - to[0] * size, a + (1 - to[0]) * size];
}

/** A span within the whole, no smaller than can be shown; null where it is the whole. */
export function within([low, high]: Span, whole: Span): Span | null {
  const length = whole[1] - whole[0];
  const size = Math.max(high - low, FINEST * length);
  if (!(size < length)) return null;
  const start = Math.min(Math.max((low + high - size) / 2, whole[0]), whole[1] - size);
  return [start, start + size];
}

/** The span moved so that a place lies in it. */
export function containing([low, high]: Span, at: number): Span {
  const by = Math.min(0, at - low) + Math.max(0, at - high);
  return [low + by, high + by];
}

/** Where in the page a plot itself lies, without its axes. */
export type Area = Pick<DOMRect, "left" | "top" | "width" | "height">;

/** Whether a tap there takes the cursor away: it is on the cursor's line, or beside the plot. */
function isAway({ left, top, width, height }: Area, cursor: number | null, { clientX, clientY }: PointerEvent): boolean {
  if (cursor === null) return false;
  const isInside = clientX >= left && clientX <= left + width && clientY >= top && clientY <= top + height;
  return !isInside || Math.abs(clientX - left - cursor * width) <= REACH;
}

/** Takes the keys of `root`, and the fingers on it. */
export function watchPlot(root: HTMLElement, area: () => Area | null, plot: Controlled): void {
  root.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const steps = event.shiftKey ? LEAP : 1;
    const actions: Record<string, () => void> = {
      "+": () => plot.zoomBy(CLOSER), "=": () => plot.zoomBy(CLOSER), "-": () => plot.zoomBy(1 / CLOSER), 0: () => plot.whole(),
      ArrowLeft: () => plot.step(-steps), ArrowRight: () => plot.step(steps), ArrowDown: () => plot.step(-steps), ArrowUp: () => plot.step(steps), Home: () => plot.step(-Infinity), End: () => plot.step(Infinity),
    };
    // Where there is no cursor to be taken away, the key is meant for something else.
    if (event.key === "Escape" && plot.cursor() !== null) actions.Escape = () => plot.release();
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  });

  /** Where each finger is, and where the first two were when the second came. */
  const fingers = new Map<number, number>();
  let from: Span | null = null;
  /** The finger that takes the cursor away if it goes no further, and where it came down. */
  let away: PointerEvent | null = null;
  const place = ({ clientX }: PointerEvent): number | null => {
    const found = area();
    return found && found.width > 0 ? (clientX - found.left) / found.width : null;
  };
  const both = (): Span => [...fingers.values()].slice(0, 2) as unknown as Span;
  root.addEventListener("pointerdown", (event) => {
    const at = event.pointerType === "touch" ? place(event) : null;
    if (at === null) return;
    // The mouse that browsers play after a finger would mark a part of the plot.
    event.preventDefault();
    root.focus({ preventScroll: true });
    // What is under the finger may be drawn anew, and would then not tell that it is lifted.
    root.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at);
    away = fingers.size === 1 && isAway(area()!, plot.cursor(), event) ? event : null;
    if (fingers.size === 1 && !away) plot.point(at);
    if (fingers.size !== 2) return;
    from = both();
    plot.pinchBegun();
  });
  root.addEventListener("pointermove", (event) => {
    const at = fingers.has(event.pointerId) ? place(event) : null;
    if (at === null) return;
    fingers.set(event.pointerId, at);
    if (away && Math.hypot(event.clientX - away.clientX, event.clientY - away.clientY) <= SLIP) return;
    away = null;
    if (from && fingers.size > 1) plot.pinch(from, both());
    // A finger that stays after a pinch means nothing.
    else if (!from) plot.point(at);
  });
  for (const kind of ["pointerup", "pointercancel"] as const) root.addEventListener(kind, (event) => {
    if (!fingers.delete(event.pointerId) || fingers.size > 0) return;
    if (away && kind === "pointerup") plot.release();
    from = away = null;
  });
}
