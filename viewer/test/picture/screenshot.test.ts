import { expect, test } from "vitest";
import { paint } from "../../src/picture/screenshot";
import type { Bar } from "../../src/picture/scene";
import { firstLook } from "../../src/store/looks";

/** A canvas that notes what is drawn on it; a letter is seven units wide. */
function context(width: number, height: number) {
  const texts: { text: string; left: number; right: number; line: number }[] = [];
  const pictures: number[][] = [];
  const ignored = (): void => undefined;
  const measureText = (text: string) => ({ width: 7 * text.length });
  const drawn = {
    canvas: { width, height }, measureText, clearRect: ignored, beginPath: ignored, roundRect: ignored, fill: ignored, fillRect: ignored,
    createLinearGradient: () => ({ addColorStop: ignored }),
    drawImage: (_: unknown, ...place: number[]) => pictures.push(place),
    fillText: (text: string, left: number, line: number) => texts.push({ text, left, right: left + measureText(text).width, line }),
  };
  return { context: drawn as unknown as CanvasRenderingContext2D, texts, pictures };
}
const picture = (width: number, height: number) => ({ width, height }) as HTMLCanvasElement;
const view = { name: "cut", kind: "slice" };
const bar = (key: string): Bar => ({ key, views: ["cut"], range: [0, 1], look: firstLook(view, [view], []), hasGaps: false });

test("titles of bars lie within the picture, and beside each other", () => {
  const { context: canvas, texts } = context(800, 800);
  const titles: Record<string, string> = { a: "velocity magnitude [m/s]", b: "p [Pa]", c: "turbulent kinetic energy [m²/s²]" };
  paint(canvas, picture(800, 800), ["a", "b", "c"].map(bar), ({ key }) => titles[key]!, "black", "white");
  const found = texts.filter(({ text }) => Object.values(titles).includes(text)).sort((a, b) => a.left - b.left);
  expect(found.length).toBe(3);
  for (const { right } of texts) expect(right).toBeLessThanOrEqual(800);
  for (let i = 1; i < found.length; i++) expect(found[i - 1]!.right).toBeLessThan(found[i]!.left);
});

test("grey is named where some values are no numbers, within the picture", () => {
  const { context: canvas, texts } = context(800, 800);
  paint(canvas, picture(800, 800), [bar("a"), { ...bar("b"), hasGaps: true }], ({ key }) => key, "black", "white");
  const found = texts.filter(({ text }) => text === "no number");
  expect(found.length).toBe(1);
  expect(found[0]!.line).toBeLessThan(790);
});

test("a bar for which a narrow picture has no room is left out", () => {
  const { context: canvas, texts } = context(200, 800);
  paint(canvas, picture(200, 800), [bar("a"), bar("b")], ({ key }) => key, "black", "white");
  expect(texts.some(({ text }) => text === "a")).toBe(true);
  expect(texts.some(({ text }) => text === "b")).toBe(false);
});

test("a picture of another shape is not stretched", () => {
  const { context: canvas, pictures } = context(400, 400);
  paint(canvas, picture(800, 400), [], () => "", "black", "white");
  paint(canvas, picture(400, 400), [], () => "", "black", "white");
  expect(pictures).toEqual([[0, 100, 400, 200], [0, 0, 400, 400]]);
});
