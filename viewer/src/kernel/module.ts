/**
 * How a WebAssembly module of `viewer/wasm` is called.
 *
 * Whatever goes wrong is a `KernelError`. Where the module itself fails, its memory is given up, and a new instance takes its place.
 */
export type FailureKind = "handle" | "input" | "json" | "frame" | "surface" | "edit" | "skeleton" | "memory" | "trap";

export class KernelError extends Error {
  constructor(readonly kind: FailureKind, message: string) {
    super(message);
    this.name = "KernelError";
  }
}

/** The exports that every module has. */
export interface Border {
  memory: WebAssembly.Memory;
  input(bytes: number): number;
  arrays(): number;
  array(index: number): number;
  array_bytes(index: number): number;
  panic_text(): number;
  panic_text_bytes(): number;
}

export const encoder = new TextEncoder();
const decoder = new TextDecoder();

/** Compiles a module while it is still arriving; `title` names it in errors. */
export async function compile(address: URL, title: string): Promise<WebAssembly.Module> {
  const lost = (why: string): KernelError => new KernelError("trap", `${title} did not arrive: ${why}`);
  const response = await fetch(address).catch((error: unknown) => { throw lost(error instanceof Error ? error.message : String(error)); });
  if (!response.ok) throw lost(`${response.status} ${response.statusText}`);
  return WebAssembly.compileStreaming(response);
}

export class Module<Exports extends Border> {
  private exports: Exports;
  /** How many instances there have been: what an earlier one had open must be opened again. */
  generation = 0;

  constructor(private readonly module: WebAssembly.Module, private readonly title: string) {
    this.exports = this.instantiate();
  }

  /** The bytes that the module's memory takes. */
  get memory(): number {
    return this.exports.memory.buffer.byteLength;
  }

  /**
   * One call: `input` is written into the module's memory one part after the other, `run` is called, and `read` reads what it
   * answers. `result` is what `run` returned.
   */
  call<T>(input: readonly Uint8Array[], run: (exports: Exports) => number, read: () => T): { result: number; answer: T } {
    try {
      const size = input.reduce((sum, part) => sum + part.byteLength, 0);
      let at = this.exports.input(size) >>> 0;
      if (at === 0) throw new KernelError("memory", `there is not enough memory for ${size} bytes`);
      for (const part of input) {
        new Uint8Array(this.exports.memory.buffer, at, part.byteLength).set(part);
        at += part.byteLength;
      }
      const result = run(this.exports) >>> 0;
      if (result === 0) {
        const [kind, ...message] = this.text(0).split("\n");
        throw new KernelError(kind as FailureKind, message.join("\n"));
      }
      return { result, answer: read() };
    } catch (error) {
      if (error instanceof KernelError) throw error;
      throw this.restart(error);
    }
  }

  /** A copy of an array of the last answer. */
  bytes(index: number): ArrayBuffer {
    const start = this.exports.array(index) >>> 0;
    return this.exports.memory.buffer.slice(start, start + (this.exports.array_bytes(index) >>> 0));
  }

  text(index: number): string {
    return decoder.decode(this.bytes(index));
  }

  private instantiate(): Exports {
    return new WebAssembly.Instance(this.module, {}).exports as unknown as Exports;
  }

  /** Gives a module up that failed in itself, and says why it did. */
  private restart(error: unknown): KernelError {
    let reason = error instanceof Error ? error.message : String(error);
    try {
      const start = this.exports.panic_text() >>> 0;
      const text = decoder.decode(this.exports.memory.buffer.slice(start, start + (this.exports.panic_text_bytes() >>> 0)));
      if (text !== "") reason = text;
    } catch {
      // Too broken to say more.
    }
    this.exports = this.instantiate();
    this.generation++;
    return new KernelError("trap", `${this.title} failed, which is a defect of it: ${reason}`);
  }
}
