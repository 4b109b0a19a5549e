/** The nodes by which a skeleton is bent: a few on each branch, instead of every node that it was extracted with. */
import type { Vector } from "../connection/protocol";
import type { Bones } from "../picture/skeleton";

/** How many control nodes a branch has, its ends counted. */
export const NODES_OF_A_BRANCH = 8;

export interface ControlNode {
  /** Its number in the skeleton. */
  node: number;
  branch: number;
  /** Ends and junctions stay where they are. */
  isPinned: boolean;
  /** Where it stands on its branch, from 1. */
  position: number;
}

/**
 * Control nodes at even distances along each branch, measured on the reference. A branch that ends in nothing but itself (a loop
 * of its own) has no pinned node. Ends that branches share are there once.
 */
export function controlNodes({ reference, curves, free }: Pick<Bones, "reference" | "curves" | "free">, count = NODES_OF_A_BRANCH): ControlNode[] {
  const movable = new Set(free);
  const known = new Set<number>();
  const result: ControlNode[] = [];
  curves.forEach((curve, branch) => {
    const lengths = [0];
    for (let i = 1; i < curve.length; i++) lengths.push(lengths[i - 1]! + apart(reference, curve[i - 1]!, curve[i]!));
    const total = lengths.at(-1) ?? 0;
    const isLoop = curve.length > 2 && curve[0] === curve.at(-1) && movable.has(curve[0]!);
    // The last node of a loop is its first.
    const steps = isLoop ? count : count - 1;
    let next = 0;
    for (let i = 0; i < count; i++) {
      const wanted = (total * i) / steps;
      while (next + 1 < curve.length && Math.abs(lengths[next + 1]! - wanted) <= Math.abs(lengths[next]! - wanted)) next++;
      const node = curve[next];
      if (node === undefined || known.has(node)) continue;
      known.add(node);
      result.push({ node, branch, isPinned: !movable.has(node), position: i + 1 });
    }
  });
  return result;
}

/** The control nodes of the same branch on both sides of one that can move. */
export function neighbours(nodes: readonly ControlNode[], of: ControlNode): ControlNode[] {
  const own = nodes.filter((other) => other.branch === of.branch && !other.isPinned && other.node !== of.node);
  const before = own.filter((other) => other.position < of.position).at(-1);
  const after = own.find((other) => other.position > of.position);
  return [before, after].filter((other) => other !== undefined);
}

/** Branches by the feature that most of their surface belongs to, numbered where several have the same. */
export function branchNames(features: readonly (string | null)[]): string[] {
  const counts = new Map<string, number>();
  for (const feature of features) counts.set(feature ?? "branch", (counts.get(feature ?? "branch") ?? 0) + 1);
  const seen = new Map<string, number>();
  return features.map((feature) => {
    const name = feature ?? "branch";
    const number = (seen.get(name) ?? 0) + 1;
    seen.set(name, number);
    return counts.get(name) === 1 && feature !== null ? name : `${name} ${number}`;
  });
}

function apart(points: ArrayLike<number>, a: number, b: number): number {
  return Math.hypot(points[3 * b]! - points[3 * a]!, points[3 * b + 1]! - points[3 * a + 1]!, points[3 * b + 2]! - points[3 * a + 2]!);
}

export const pointOf = (points: ArrayLike<number>, node: number): Vector => [points[3 * node]!, points[3 * node + 1]!, points[3 * node + 2]!];
