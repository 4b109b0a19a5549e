/** Clusters the points of views away from the thread that draws. */
import { cluster } from "./clustering";
import type { ClusterAnswer, ClusterQuestion } from "./clusterer";

const worker = self as unknown as {
  onmessage: ((event: MessageEvent<ClusterQuestion>) => void) | null;
  postMessage(answer: ClusterAnswer, transfer: Transferable[]): void;
};

worker.onmessage = ({ data: { points, triangles, features } }) => {
  const clusters = cluster(points, triangles, features);
  worker.postMessage(clusters, clusters ? [clusters.representatives.buffer, clusters.triangles.buffer] : []);
};
