/** The names of monitors as people read them: `pressure.l2` is "Pressure, RMS". */
import { words } from "../number";
import { own } from "../own";
import { capital } from "../store/run";

/** What a measure is called, where its name in the JSON is no word (`pipelines/src/language`). */
const MEASURES: Readonly<Record<string, string>> = {
  min: "minimum", max: "maximum", l2: "RMS", rms: "RMS over time", non_finite: "values that are no number", inverted: "inverted cells",
};

/** Names as short as symbols, such as `p` or `Cd`, stay as they are: a capital would be another symbol. */
const SYMBOL = 2;

/** A monitor in words: what it is of, and what of it is measured. */
export function monitorText(name: string): string {
  const [of = "", ...measure] = name.split(".");
  const title = of.length > SYMBOL ? capital(words(of)) : words(of);
  const measured = measure.map((part) => (own(MEASURES, part) ?? words(part))).join(" ");
  return measured === "" ? title : `${title}, ${measured}`;
}

/** Which monitor it is, for what stands under the pointer: the name by which conditions and files call it. */
export const monitorHint = (pipeline: string, name: string): string => `${name}, of the pipeline ${pipeline}`;
