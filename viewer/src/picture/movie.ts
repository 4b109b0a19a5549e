/** The picture as a film, for as long as somebody lets it run. */
import { download } from "../dom";

/** Pictures a second, and bits a second. */
const RATE = 30, BITS = 8_000_000;
/** A film ends by itself before the page holds more bytes of it than these. */
const MOST = 500_000_000;
/** Formats that browsers write, the best liked first. */
const FORMATS = ["video/mp4;codecs=avc1.42E01F", "video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

export class Movie {
  private recorder: MediaRecorder | null = null;

  /** `told` hears whether one is being made. */
  constructor(private readonly canvas: () => HTMLCanvasElement | null, private readonly name: () => string, private readonly told: (isRunning: boolean) => void, private readonly trouble: (text: string) => void) {}

  toggle(): void {
    if (this.recorder) this.recorder.stop();
    else this.start();
  }

  private start(): void {
    const canvas = this.canvas();
    const format = typeof MediaRecorder === "undefined" ? undefined : FORMATS.find((candidate) => MediaRecorder.isTypeSupported(candidate));
    if (!canvas || format === undefined) return this.trouble("this browser cannot make films");
    const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: format, videoBitsPerSecond: BITS });
    const parts: Blob[] = [];
    let bytes = 0;
    recorder.addEventListener("dataavailable", ({ data }) => {
      parts.push(data);
      bytes += data.size;
      if (bytes > MOST && recorder.state === "recording") recorder.stop();
    });
    recorder.addEventListener("stop", () => {
      this.recorder = null;
      for (const track of recorder.stream.getTracks()) track.stop();
      this.told(false);
      download(new Blob(parts, { type: format }), `${this.name()}.${format.startsWith("video/mp4") ? "mp4" : "webm"}`);
    });
    recorder.addEventListener("error", () => this.trouble("the film could not be made"));
    recorder.start(1000);
    this.recorder = recorder;
    this.told(true);
  }
}
