/** Pinned probes: places of the mesh whose value is plotted over time, and marked in the picture. */
import type { History } from "../history/series";
import { seriesKey } from "../history/series";
import type { Marks } from "./marks";
import type { Probe, ProbeReading } from "./probe";

/** The most pins at once. */
const PINS = 8;

interface Pin { name: string; probe: Probe; series: Set<string> }

export class Pins {
  private pins: Pin[] = [];
  private count = 0;

  /** `describe` names the field that a reading is of, and its unit. */
  constructor(
    private readonly history: History, private readonly marks: Marks, private readonly read: (probe: Probe) => ProbeReading | null,
    private readonly describe: (reading: ProbeReading) => { name: string; unit: string | null }, private readonly chosen: (key: string) => void,
  ) {}

  /** Pins a place, and has it plotted. The oldest goes where there are too many. */
  add(probe: Probe): void {
    const pin = { name: `probe ${++this.count}`, probe, series: new Set<string>() };
    if (this.pins.length >= PINS) this.remove(this.pins[0]!);
    this.pins.push(pin);
    this.update();
  }

  clear(): void {
    for (const pin of [...this.pins]) this.remove(pin);
    this.update();
  }

  /** Something else is drawn: another frame, or another field. Says whether there were values to take. */
  update(): boolean {
    let taken = false;
    const marks = this.pins.flatMap((pin) => {
      const reading = this.read(pin.probe);
      if (!reading) return [];
      if (reading.field !== null) {
        const { name, unit } = this.describe(reading);
        // Of another field: another source, so that both may have the same cycles.
        const source = `${pin.name}, ${name}`;
        this.history.add(source, reading.cycle, reading.time, { [name]: reading.value });
        this.history.setUnit(source, name, unit);
        taken = true;
        if (!pin.series.has(source)) {
          pin.series.add(source);
          this.chosen(seriesKey(source, name));
        }
      }
      return [{ points: [reading.point], label: pin.name, kind: "probe" as const }];
    });
    this.marks.set("pins", marks);
    return taken;
  }

  private remove(pin: Pin): void {
    this.pins = this.pins.filter((other) => other !== pin);
    for (const source of pin.series) this.history.remove(source);
  }
}
