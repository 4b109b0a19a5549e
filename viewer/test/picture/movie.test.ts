// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import * as dom from "../../src/dom";
import { Movie } from "../../src/picture/movie";

/** Stands in for what browsers make films with. */
class Recorder extends EventTarget {
  static made: Recorder[] = [];
  static supported: string[] = [];
  static isTypeSupported(type: string): boolean { return Recorder.supported.includes(type); }
  state = "inactive";
  readonly stopped: string[] = [];
  readonly stream: { getTracks(): { stop(): void }[] };
  constructor(stream: { canvas: HTMLCanvasElement }, readonly options: { mimeType: string }) {
    super();
    this.canvas = stream.canvas;
    this.stream = { getTracks: () => [{ stop: () => { this.stopped.push("track"); } }] };
    Recorder.made.push(this);
  }
  readonly canvas: HTMLCanvasElement;
  start(): void { this.state = "recording"; }
  stop(): void {
    this.state = "inactive";
    this.dispatchEvent(new Event("stop"));
  }
  give(size: number): void { this.dispatchEvent(Object.assign(new Event("dataavailable"), { data: { size } })); }
}

describe("a film", () => {
  let picture: HTMLCanvasElement | null;
  let painted: number;
  let told: boolean[];
  let troubles: string[];
  let files: [number, string, string][];
  let movie: Movie;
  beforeEach(() => {
    [picture, painted, told, troubles, files, Recorder.made, Recorder.supported] = [document.createElement("canvas"), 0, [], [], [], [], ["video/webm;codecs=vp8", "video/webm"]];
    Object.defineProperties(picture, { clientWidth: { value: 801 }, clientHeight: { value: 600 } });
    vi.stubGlobal("MediaRecorder", Recorder);
    vi.stubGlobal("Blob", class { constructor(readonly parts: unknown[], readonly options: { type: string }) { /* Only what is in it is looked at. */ } });
    vi.spyOn(HTMLCanvasElement.prototype, "getContext").mockReturnValue({} as never);
    Object.assign(HTMLCanvasElement.prototype, { captureStream(this: HTMLCanvasElement) { return { canvas: this }; } });
    vi.spyOn(dom, "download").mockImplementation((blob, name) => {
      const { parts, options } = blob as unknown as { parts: unknown[]; options: { type: string } };
      files.push([parts.length, options.type, name]);
    });
    movie = new Movie(() => picture, () => { painted++; }, { name: () => "run-7", told: (isRunning) => told.push(isRunning), trouble: (text) => troubles.push(text) });
    return () => {
      vi.unstubAllGlobals();
      vi.restoreAllMocks();
    };
  });

  it("takes each picture while it runs, in the best format that the browser writes, and is a file in the end", () => {
    movie.drawn();
    movie.toggle();
    const [recorder] = Recorder.made;
    expect([recorder!.options.mimeType, recorder!.canvas.width, recorder!.canvas.height, told]).toEqual(["video/webm;codecs=vp8", 800, 600, [true]]);
    movie.drawn();
    movie.drawn();
    for (const size of [10, 20]) recorder!.give(size);
    expect(files).toEqual([]);
    movie.toggle();
    movie.drawn();
    expect([painted, told, files, recorder!.stopped]).toEqual([2, [true, false], [[2, "video/webm;codecs=vp8", "run-7.webm"]], ["track"]]);
    // And another one.
    Recorder.supported.push("video/mp4;codecs=avc1.42E01F");
    movie.toggle();
    movie.toggle();
    expect(files[1]).toEqual([0, "video/mp4;codecs=avc1.42E01F", "run-7.mp4"]);
  });

  it("ends by itself before the page holds too much of it", () => {
    movie.toggle();
    const [recorder] = Recorder.made;
    recorder!.give(400_000_000);
    expect(told).toEqual([true]);
    recorder!.give(200_000_000);
    recorder!.give(200_000_000);
    expect([told, files.length]).toEqual([[true, false], 1]);
  });

  it("is refused in words where the browser makes none, or there is no picture", () => {
    Recorder.supported = [];
    movie.toggle();
    vi.stubGlobal("MediaRecorder", undefined);
    movie.toggle();
    vi.stubGlobal("MediaRecorder", Recorder);
    Recorder.supported = ["video/webm"];
    picture = null;
    movie.toggle();
    expect([troubles, told, Recorder.made.length]).toEqual([Array(3).fill("this browser cannot make films"), [], 0]);
  });
});
