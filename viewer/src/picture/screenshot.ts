/** The picture with its scalar bars, and as a PNG. */
import { download, element } from "../dom";
import { colourMap } from "./colour";
import { valueAt } from "./ranges";
import { within } from "../number";
import type { Bar } from "./scene";

/** Draws the bars over a picture, in its lower right corner. `title` names what a bar stands for. */
export function withBars(picture: HTMLCanvasElement, bars: readonly Bar[], title: (bar: Bar) => string, ink: string): HTMLCanvasElement {
  const canvas = element("canvas", { width: picture.width, height: picture.height });
  const context = canvas.getContext("2d");
  if (!context) return picture;
  paint(context, picture, bars, title, ink);
  return canvas;
}

/** Fills a canvas with a picture and its bars. */
export function paint(context: CanvasRenderingContext2D, picture: HTMLCanvasElement, bars: readonly Bar[], title: (bar: Bar) => string, ink: string): void {
  const { width: across, height: down } = context.canvas;
  context.drawImage(picture, 0, 0, across, down);
  const unit = Math.max(1, down / 800);
  context.font = `${12 * unit}px sans-serif`;
  context.fillStyle = ink;
  context.textBaseline = "middle";
  bars.forEach((bar, i) => {
    const [left, top, width, height] = [across - (110 + 130 * i) * unit, down - 230 * unit, 14 * unit, 190 * unit];
    const { stops } = colourMap(bar.look.map);
    const gradient = context.createLinearGradient(0, top + height, 0, top);
    stops.forEach((stop, at) => gradient.addColorStop(at / (stops.length - 1), `rgb(${stop.map((part) => Math.round(255 * part)).join(" ")})`));
    context.fillText(title(bar), left, top - 16 * unit);
    context.save();
    context.fillStyle = gradient;
    context.fillRect(left, top, width, height);
    context.restore();
    for (let tick = 0; tick <= 5; tick++) {
      const value = valueAt(bar.range, tick / 5, bar.look.range.logarithmic);
      context.fillText(within(value, bar.look.range.logarithmic ? [0, value] : bar.range), left + width + 8 * unit, top + height * (1 - tick / 5));
    }
  });
}

/** Hands a canvas to the person as a file. */
export function save(canvas: HTMLCanvasElement, name: string): void {
  canvas.toBlob((blob) => {
    if (blob) download(blob, name);
  }, "image/png");
}
