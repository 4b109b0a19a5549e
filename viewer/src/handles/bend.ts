/** A branch of the skeleton bent at one of its control nodes, by an angle and in a plane that are said in numbers. */
import type { Vector } from "../connection/protocol";
import { toStep } from "./rounding";
import { length, subtract, times, transformed, turn } from "./vector";

/** A control node as it stands on its branch. */
export interface BranchNode { place: Vector; isPinned: boolean }

/** The planes in which a bend is asked for, and the direction about which each turns. */
export const PLANES: Readonly<Record<string, Vector>> = { xy: [0, 0, 1], yz: [1, 0, 0], xz: [0, 1, 0] };

/**
 * How far each node of a branch goes so that the branch bends at the node `at` by an angle about `axis`: the side behind it turns by one
 * half, the side before it by the other, the opposite way. The nodes beside it turn exactly; farther ones less and less, towards an end
 * that stays where it is. Where one side has nothing to turn, the other turns by the whole angle. Null where neither has.
 */
export function bent(branch: readonly BranchNode[], at: number, axis: Vector, degrees: number): Vector[] | null {
  const pivot = branch[at];
  if (!pivot) return null;
  const behind = indices(at + 1, branch.length), before = indices(0, at).reverse();
  const movable = [before, behind].filter(([next]) => next !== undefined && !branch[next]!.isPinned).length;
  if (movable === 0) return null;
  const ways = branch.map((): Vector => [0, 0, 0]);
  // The dust of the rotation, held against the branch, is less than what anybody means.
  const step = 10 ** (Math.floor(Math.log10(distances(branch, 0, indices(1, branch.length)).at(-1) || 1)) - 9);
  for (const [side, sense] of [[behind, 1], [before, -1]] as const) {
    const [next] = side;
    if (next === undefined || branch[next]!.isPinned) continue;
    const matrix = turn(axis, (sense * degrees) / movable);
    const away = distances(branch, at, side);
    const [first, end] = [away[0]!, away.at(-1)!];
    const isHeld = branch[side.at(-1)!]!.isPinned;
    side.forEach((index, i) => {
      const node = branch[index]!;
      if (node.isPinned) return;
      const part = isHeld && end > first ? (end - away[i]!) / (end - first) : 1;
      const from = subtract(node.place, pivot.place);
      const way = times(subtract(transformed(matrix, from), from), part);
      ways[index] = way.map((value) => toStep(value, step)) as Vector;
    });
  }
  return ways;
}

const indices = (from: number, to: number): number[] => Array.from({ length: Math.max(0, to - from) }, (_, i) => from + i);

/** How far along the branch the nodes of one side are from the node `at`. */
function distances(branch: readonly BranchNode[], at: number, side: readonly number[]): number[] {
  let last = at, sum = 0;
  return side.map((index) => {
    sum += length(subtract(branch[index]!.place, branch[last]!.place));
    last = index;
    return sum;
  });
}
