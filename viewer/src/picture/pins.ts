/** Pinned probes: places of the mesh whose value is plotted over time, and marked in the picture. */
import type { Vector } from "../connection/protocol";
import type { History } from "../history/series";
import { seriesKey } from "../history/series";
import type { Marks } from "./marks";
import type { Probe, ProbeReading } from "./probe";

/** The most pins at once. */
export const PINS = 8;

/** A pin as it is kept while the page is loaded again: the place is found anew where it was last. */
export interface KeptPin { name: string; view: string; point: Vector }

/** `point` is where it was last, and `sought` the topology in which it was looked for last. */
interface Pin { name: string; probe: Probe; point: Vector | null; sought: string | null; series: Set<string>; isNew: boolean }

/** The place of a pin that has to be found yet: no triangle of any topology. */
const nowhere = (view: string): Probe => ({ view, topology: "", triangle: 0, weights: [1, 0, 0] });

/** What pins need of the picture. */
export interface PinSource {
  read(probe: Probe): ProbeReading | null;
  near(view: string, point: Vector): Probe | null;
  topologyOf(view: string): string | null | undefined;
}

export class Pins {
  private pins: Pin[] = [];
  private count = 0;

  /**
   * `describe` names the field that a reading is of, and its unit. `chosen` has a series plotted, of a pin that is new or one that is there
   * again; `changed` is called when there are other pins.
   */
  constructor(
    private readonly history: History, private readonly marks: Pick<Marks, "set">, private readonly source: PinSource,
    private readonly describe: (reading: ProbeReading) => { name: string; unit: string | null }, private readonly chosen: (key: string, isNew: boolean) => void,
    private readonly changed: () => void,
  ) {}

  /** The views in which there are pins. */
  get views(): ReadonlySet<string> {
    return new Set(this.pins.map(({ probe }) => probe.view));
  }

  /** Pins a place, and has it plotted. The oldest goes where there are too many. */
  add(probe: Probe): void {
    const pin: Pin = { name: `probe ${++this.count}`, probe, point: null, sought: null, series: new Set(), isNew: true };
    if (this.pins.length >= PINS) this.remove(this.pins[0]!);
    this.pins.push(pin);
    this.changed();
    this.update();
  }

  /** What is to be kept while the page is loaded again. */
  get kept(): KeptPin[] {
    return this.pins.flatMap(({ name, probe, point }) => (point ? [{ name, view: probe.view, point }] : []));
  }

  /** Pins again what was kept. Each is found once its view has values. */
  restore(pins: readonly KeptPin[]): void {
    this.pins = pins.map(({ name, view, point }) => ({ name, probe: nowhere(view), point, sought: null, series: new Set(), isNew: false }));
    this.count = Math.max(this.count, ...pins.map(({ name }) => Number(/\d+$/.exec(name))));
    this.changed();
  }

  clear(): void {
    for (const pin of [...this.pins]) this.remove(pin);
    this.changed();
    this.update();
  }

  /** Something else is drawn: another frame, or another field. Says whether there were values to take. */
  update(): boolean {
    let taken = false;
    const marks = this.pins.flatMap((pin) => {
      const reading = this.read(pin);
      if (!reading) {
        // Without values nobody can say yet whether it is there.
        const isGone = this.source.topologyOf(pin.probe.view) !== null;
        return pin.point ? [{ points: [pin.point], label: isGone ? `${pin.name}: the place is gone` : pin.name, kind: "probe" as const }] : [];
      }
      pin.point = reading.point;
      if (reading.field !== null) {
        const { name, unit } = this.describe(reading);
        // Of another field: another source, so that both may have the same cycles.
        const source = `${pin.name}, ${name}`;
        this.history.add(source, reading.cycle, reading.time, { [name]: reading.value });
        this.history.setUnit(source, name, unit);
        taken = true;
        if (!pin.series.has(source)) {
          pin.series.add(source);
          this.chosen(seriesKey(source, name), pin.isNew);
        }
      }
      return [{ points: [reading.point], label: pin.name, kind: "probe" as const }];
    });
    this.marks.set("pins", marks);
    return taken;
  }

  /** What is read at a pin. In another topology its triangle is another one: the place is found anew, once for each topology. */
  private read(pin: Pin): ProbeReading | null {
    const topology = this.source.topologyOf(pin.probe.view) ?? null;
    if (topology !== null && topology !== pin.probe.topology && topology !== pin.sought && pin.point) {
      pin.sought = topology;
      pin.probe = this.source.near(pin.probe.view, pin.point) ?? pin.probe;
    }
    return this.source.read(pin.probe);
  }

  private remove(pin: Pin): void {
    this.pins = this.pins.filter((other) => other !== pin);
    // Those of a pin that is there again are older than what it has read itself.
    for (const { source } of this.history.series) if (source.startsWith(`${pin.name}, `)) this.history.remove(source);
  }
}
