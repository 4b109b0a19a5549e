import { describe, expect, it } from "vitest";
import { NODES_OF_A_BRANCH, branchNames, controlNodes, neighbours } from "../../src/handles/control-nodes";
import { NodeComposer } from "../../src/handles/skeleton-target";
import { segmentsOf } from "../../src/picture/skeleton";
import type { Vector } from "../../src/connection/protocol";
import { length, subtract } from "../../src/handles/vector";

/** A Y: three legs of 21 nodes that meet in node 0, the nodes of the first bunched up at its end. */
function ypsilon(): Parameters<typeof controlNodes>[0] {
  const reference: number[] = [0, 0, 0];
  const curves = [0, 1, 2].map((leg) => {
    const angle = (leg * 2 * Math.PI) / 3;
    const nodes = Array.from({ length: 20 }, (_, i) => {
      const t = (i + 1) / 20, r = leg === 0 ? Math.sqrt(t) : t;
      reference.push(r * Math.cos(angle), r * Math.sin(angle), 0);
      return reference.length / 3 - 1;
    });
    return Uint32Array.from([0, ...nodes]);
  });
  return { reference: Float64Array.from(reference), curves, free: segmentsOf(curves, reference.length / 3).free };
}

describe("control nodes", () => {
  it("lie evenly along each branch, with ends and junctions, which are there once and stay", () => {
    const nodes = controlNodes(ypsilon());
    expect(nodes).toHaveLength(3 * (NODES_OF_A_BRANCH - 1) + 1);
    expect(nodes.filter(({ isPinned }) => isPinned)).toHaveLength(4);
    const { reference } = ypsilon();
    for (const { node, branch, position } of nodes) {
      const away = Math.hypot(reference[3 * node]!, reference[3 * node + 1]!);
      expect(Math.abs(away - (position - 1) / 7), `node ${position} of branch ${branch}`).toBeLessThan(branch === 0 ? 0.1 : 0.026);
    }
  });

  it("take every node of a short branch, and of a loop of its own pin none", () => {
    const short = [Uint32Array.of(0, 1, 2)];
    expect(controlNodes({ reference: Float64Array.from([0, 0, 0, 1, 0, 0, 2, 0, 0]), curves: short, free: segmentsOf(short, 3).free }).map(({ node }) => node).sort((a, b) => a - b)).toEqual([0, 1, 2]);
    const ring = Array.from({ length: 40 }, (_, i) => [Math.cos((i * Math.PI) / 20), Math.sin((i * Math.PI) / 20), 0]).flat();
    const loop = [Uint32Array.from([...Array(40).keys(), 0])];
    const nodes = controlNodes({ reference: Float64Array.from(ring), curves: loop, free: segmentsOf(loop, 40).free });
    expect(nodes.map(({ node }) => node)).toEqual([0, 5, 10, 15, 20, 25, 30, 35]);
    expect(nodes.some(({ isPinned }) => isPinned)).toBe(false);
  });

  it("know those beside them that can move", () => {
    const nodes = controlNodes(ypsilon());
    const second = nodes.find(({ branch, position }) => branch === 1 && position === 2)!;
    expect(neighbours(nodes, second).map(({ branch, position }) => [branch, position])).toEqual([[1, 3]]);
    const fourth = nodes.find(({ branch, position }) => branch === 1 && position === 4)!;
    expect(neighbours(nodes, fourth).map(({ position }) => position)).toEqual([3, 5]);
  });

  it("are named after the feature that their branch carries", () => {
    expect(branchNames(["artery", "artery", "bypass", null])).toEqual(["artery 1", "artery 2", "bypass", "branch 1"]);
  });
});

describe("a gesture on control nodes", () => {
  const held = (x: number, by: Vector = [0, 0, 0]) => ({ at: [x, 0, 0] as Vector, place: [x + by[0], by[1], by[2]] as Vector, by });

  it("drags those that are chosen together, each an entry of its own, and keeps the drags that there are", () => {
    const there = [{ at: [9, 0, 0], by: [0, 1, 0] }];
    const composer = new NodeComposer(there, held(2, [0, 0.5, 0]), [held(1)], [held(3)]);
    const { key, values } = composer.compose({ kind: "arrow", axis: 1 }, { kind: "move", by: [0, 2, 0] });
    expect(key).toBe("skeleton");
    expect(values.moves).toEqual([...there, { at: [2, 0, 0], by: [0, 2, 0] }, { at: [1, 0, 0], by: [0, 1.5, 0] }]);
    expect(composer.start({ kind: "arrow" })).toEqual({ kind: "move", by: [0, 0.5, 0] });
  });

  it("bends a branch by exactly 20 degrees about a node: the nodes beside it turn, it stays", () => {
    const composer = new NodeComposer([], held(2), [], [held(1), held(3)]);
    const moves = composer.compose({ kind: "ring", axis: 2 }, { kind: "turn", degrees: 20 }).values.moves as { at: Vector; by: Vector }[];
    expect(moves[0]).toEqual({ at: [2, 0, 0], by: [0, 0, 0] });
    for (const { at, by } of moves.slice(1)) {
      const before = subtract(at, [2, 0, 0]), after = subtract([at[0] + by[0], by[1], by[2]], [2, 0, 0]);
      expect(length(after)).toBeCloseTo(1, 8);
      expect((Math.acos((before[0] * after[0] + before[1] * after[1]) / length(after)) * 180) / Math.PI).toBeCloseTo(20, 6);
      expect(by[2]).toBe(0);
    }
  });
});
