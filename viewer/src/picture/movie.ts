/** The picture as a film, with its scalar bars, for as long as somebody lets it run. */
import { download, element } from "../dom";

/** Pictures a second, and bits a second. */
const RATE = 30, BITS = 8_000_000;
/** A film ends by itself before the page holds more bytes of it than these. */
const MOST = 500_000_000;
/** Formats that browsers write, the best liked first. */
const FORMATS = ["video/mp4;codecs=avc1.42E01F", "video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

export interface MovieListener {
  /** What the file is called, without its ending. */
  name(): string;
  /** Whether a film is being made. */
  told(isRunning: boolean): void;
  trouble(text: string): void;
}

export class Movie {
  private recorder: MediaRecorder | null = null;
  private context: CanvasRenderingContext2D | null = null;

  /** `picture` is the canvas that is filmed, `paint` fills another one with it and what belongs to it. */
  constructor(
    private readonly picture: () => HTMLCanvasElement | null,
    private readonly paint: (context: CanvasRenderingContext2D, picture: HTMLCanvasElement) => void, private readonly listener: MovieListener,
  ) {}

  toggle(): void {
    if (this.recorder) this.recorder.stop();
    else this.start();
  }

  /** A picture was drawn. To be called in the same task, after which the canvas may be empty. */
  drawn(): void {
    const picture = this.recorder && this.picture();
    if (picture && this.context) this.paint(this.context, picture);
  }

  private start(): void {
    const picture = this.picture();
    const format = typeof MediaRecorder === "undefined" ? undefined : FORMATS.find((candidate) => MediaRecorder.isTypeSupported(candidate));
    // A film has one size from its beginning to its end, of even numbers: that of the picture at rest, also where it is moved now.
    const even = (size: number): number => Math.max(2, 2 * Math.floor(size / 2));
    const pixels = window.devicePixelRatio || 1;
    const canvas = picture && element("canvas", { width: even(picture.clientWidth * pixels), height: even(picture.clientHeight * pixels) });
    this.context = canvas?.getContext("2d") ?? null;
    if (!canvas || !this.context || format === undefined) return this.listener.trouble("this browser cannot make films");
    const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: format, videoBitsPerSecond: BITS });
    const parts: Blob[] = [];
    let bytes = 0;
    recorder.addEventListener("dataavailable", ({ data }) => {
      parts.push(data);
      bytes += data.size;
      if (bytes > MOST && recorder.state === "recording") recorder.stop();
    });
    recorder.addEventListener("stop", () => {
      [this.recorder, this.context] = [null, null];
      for (const track of recorder.stream.getTracks()) track.stop();
      this.listener.told(false);
      download(new Blob(parts, { type: format }), `${this.listener.name()}.${format.startsWith("video/mp4") ? "mp4" : "webm"}`);
    });
    recorder.addEventListener("error", () => this.listener.trouble("the film could not be made"));
    recorder.start(1000);
    this.recorder = recorder;
    this.listener.told(true);
  }
}
