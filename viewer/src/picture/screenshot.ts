/** The picture with its scalar bars, and as a PNG. */
import { download, element } from "../dom";
import { GREY, NO_NUMBER_TEXT, colourMap } from "./colour";
import { isOfOneValue, onScale, textIn } from "./ranges";
import type { Bar } from "./scene";

/** Draws the bars over a picture, in its lower right corner, on grounds of a colour. `title` names what a bar stands for. */
export function withBars(picture: HTMLCanvasElement, bars: readonly Bar[], title: (bar: Bar) => string, ink: string, ground: string): HTMLCanvasElement {
  const canvas = element("canvas", { width: picture.width, height: picture.height });
  const context = canvas.getContext("2d");
  if (!context) return picture;
  paint(context, picture, bars, title, ink, ground);
  return canvas;
}

/** Fills a canvas with a picture, as large as it fits in, and its bars. */
export function paint(context: CanvasRenderingContext2D, picture: HTMLCanvasElement, bars: readonly Bar[], title: (bar: Bar) => string, ink: string, ground: string): void {
  const { width: across, height: down } = context.canvas;
  const scale = Math.min(across / picture.width, down / picture.height);
  const [width, height] = [picture.width * scale, picture.height * scale];
  if (width < across || height < down) context.clearRect(0, 0, across, down);
  context.drawImage(picture, (across - width) / 2, (down - height) / 2, width, height);
  const unit = Math.max(1, down / 800);
  context.font = `${12 * unit}px sans-serif`;
  context.textBaseline = "middle";
  let right = across - 12 * unit;
  for (const bar of bars) {
    const room = Math.max(98 * unit, context.measureText(title(bar)).width);
    // What has no room left of the others is not begun.
    if (right - room < 0) break;
    paintBar(context, bar, title(bar), [right - room, down - (bar.hasGaps ? 254 : 230) * unit], room, unit, ink, ground);
    right -= room + 32 * unit;
  }
}

function paintBar(context: CanvasRenderingContext2D, bar: Bar, title: string, [left, top]: [number, number], room: number, unit: number, ink: string, ground: string): void {
  const [width, height] = [14 * unit, 190 * unit];
  context.fillStyle = ground;
  context.beginPath();
  context.roundRect(left - 8 * unit, top - 28 * unit, room + 16 * unit, height + (bar.hasGaps ? 64 : 40) * unit, 6 * unit);
  context.fill();
  context.fillStyle = ink;
  context.fillText(title, left, top - 16 * unit);
  for (let tick = 0; tick <= 5; tick++) {
    if (tick % 5 !== 0 && isOfOneValue(bar.range)) continue;
    const { logarithmic } = bar.look.range;
    context.fillText(textIn(onScale(bar.range, tick / 5, logarithmic), bar.range, logarithmic), left + width + 8 * unit, top + height * (1 - tick / 5));
  }
  if (bar.hasGaps) {
    context.fillText(NO_NUMBER_TEXT, left + width + 8 * unit, top + height + 22 * unit);
    context.fillStyle = GREY;
    context.fillRect(left, top + height + 16 * unit, width, 12 * unit);
  }
  const { stops } = colourMap(bar.look.map);
  const gradient = context.createLinearGradient(0, top + height, 0, top);
  stops.forEach((stop, at) => gradient.addColorStop(at / (stops.length - 1), `rgb(${stop.map((part) => Math.round(255 * part)).join(" ")})`));
  context.fillStyle = gradient;
  context.fillRect(left, top, width, height);
}

/** Hands a canvas to the person as a file. */
export function save(canvas: HTMLCanvasElement, name: string): void {
  canvas.toBlob((blob) => {
    if (blob) download(blob, name);
  }, "image/png");
}
