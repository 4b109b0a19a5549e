/** Has the points of large views clustered on another thread, once a topology, and only of one that stays for a moment. */
import type { TopologyFrame } from "../connection/protocol";
import { MOST_TRIANGLES } from "./clustering";
import type { Clusters } from "./clustering";

/** How long a topology is there before it is clustered, in milliseconds: one that changes with each frame is gone by then, and pictures come first. */
export const PATIENCE = 500;

export interface ClusterQuestion { points: Float32Array; triangles: Uint32Array; features: Uint32Array | null }
/** Null where a view is to be drawn whole. */
export type ClusterAnswer = Clusters | null;

/** The part of a worker that is needed, so that a test can stand in for it. */
export interface ClusterWorker {
  postMessage(question: ClusterQuestion): void;
  onmessage: ((event: MessageEvent<ClusterAnswer>) => void) | null;
  onerror: ((event: ErrorEvent) => void) | null;
}

interface Wish { topology: TopologyFrame; points: Float32Array; answered: (clusters: ClusterAnswer) => void }

export class Clusterer {
  private worker: ClusterWorker | null = null;
  private readonly waiting: Wish[] = [];
  private underway: Wish | null = null;
  private readonly known = new WeakMap<TopologyFrame, ClusterAnswer>();

  /** `start` makes the worker when it is first needed. */
  constructor(private readonly start: () => ClusterWorker) {}

  /** Asks for the clusters of a topology whose points lie so; returns what takes the wish back. */
  want(topology: TopologyFrame, points: Float32Array, answered: (clusters: ClusterAnswer) => void): () => void {
    if (topology.triangles.length / 3 <= MOST_TRIANGLES) return () => undefined;
    const wish = { topology, points, answered };
    const timer = setTimeout(() => {
      this.waiting.push(wish);
      this.next();
    }, PATIENCE);
    return () => {
      clearTimeout(timer);
      const at = this.waiting.indexOf(wish);
      if (at >= 0) this.waiting.splice(at, 1);
      wish.answered = () => undefined;
    };
  }

  private next(): void {
    if (this.underway) return;
    const wish = this.waiting.shift();
    if (!wish) return;
    // A moment that is kept has the topology of now.
    const known = this.known.get(wish.topology);
    if (known !== undefined) {
      wish.answered(known);
      return this.next();
    }
    this.underway = wish;
    try {
      this.started().postMessage({ points: wish.points, triangles: wish.topology.triangles, features: wish.topology.triangleFeatures });
    } catch (error) {
      // oxlint-disable-next-line no-console -- a picture drawn whole is nothing to trouble a person with.
      console.error(error);
      this.take(null);
    }
  }

  private started(): ClusterWorker {
    if (this.worker) return this.worker;
    this.worker = this.start();
    this.worker.onmessage = ({ data }) => this.take(data);
    // Without clusters pictures are drawn whole; what is wrong is said in the console of the browser.
    this.worker.onerror = () => this.take(null);
    return this.worker;
  }

  private take(clusters: ClusterAnswer): void {
    const wish = this.underway;
    this.underway = null;
    if (wish) {
      this.known.set(wish.topology, clusters);
      wish.answered(clusters);
    }
    this.next();
  }
}

/** That of all pictures of the page. */
export const clusterer = new Clusterer(() => new Worker(new URL("./clustering.worker.ts", import.meta.url), { type: "module" }));
