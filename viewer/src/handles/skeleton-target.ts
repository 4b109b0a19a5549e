/** The control nodes of the skeleton as something to grip: dragged, several at once, or turned about one of them. */
import type { Json, Vector } from "../connection/protocol";
import { svg } from "../dom";
import type { Bones } from "../picture/skeleton";
import { nearestWithin } from "../picture/skeleton";
import type { Values } from "../form/schema";
import { asksNothing, bodyOf, isObject, kindOf, withMove } from "../store/draft";
import type { State } from "../store/state";
import { branchNames, controlNodes, neighbours, pointOf } from "./control-nodes";
import type { ControlNode } from "./control-nodes";
import type { Composer } from "./gesture";
import type { Picture, Target } from "./handles";
import type { Amount } from "./motion";
import type { Place } from "./projection";
import { toStep } from "./rounding";
import { lengthUnit } from "./shape-target";
import { vectorOf } from "./shape-composer";
import { add, length, subtract, transformed, turn, unit } from "./vector";
import { bent } from "./bend";

const SIZE = { pinned: 3, free: 5, hovered: 8 };

/** A node that takes part in a gesture: where it is drawn when the gesture begins, and how far the form drags it already. */
interface Held { at: Vector; place: Vector; by: Vector }

export class SkeletonTarget implements Target {
  readonly kinds = ["ring", "plane", "arrow"] as const;
  private bones: Bones | null = null;
  private nodes: ControlNode[] = [];
  private names: string[] = [];
  /** The nodes that are meant, the one last gripped at the end. */
  private meant: number[] = [];
  private places = new Float32Array(0);
  private hovered = -1;
  private readonly circles: SVGCircleElement[] = [];
  private readonly root = svg("g", { class: "nodes" });

  constructor(overlay: SVGElement, private readonly state: () => State, private readonly picture: Picture) {
    overlay.prepend(this.root);
  }

  /** Draws the nodes where the picture is now seen from. */
  drawn(): void {
    const bones = this.picture.shownBones;
    if (bones?.curves !== this.bones?.curves) {
      this.nodes = bones ? controlNodes(bones) : [];
      this.names = bones ? branchNames(bones.features) : [];
      this.meant = [];
      this.hovered = -1;
    }
    this.bones = bones;
    if (this.nodes.length === 0 && this.circles.every((circle) => circle.getAttribute("r") === "0")) return;
    const projection = bones ? this.picture.projection() : null;
    this.places = new Float32Array(2 * this.nodes.length).fill(NaN);
    while (this.circles.length < this.nodes.length) {
      const circle = svg("circle");
      this.circles.push(circle);
      this.root.append(circle);
    }
    this.circles.forEach((circle, i) => {
      const node = this.nodes[i];
      const place = node && projection?.toPicture(this.now(node.node));
      circle.setAttribute("r", String(!node || !place ? 0 : node.isPinned ? SIZE.pinned : i === this.hovered ? SIZE.hovered : SIZE.free));
      if (!node || !place) return;
      if (!node.isPinned) this.places.set(place, 2 * i);
      circle.setAttribute("class", node.isPinned ? "pinned" : this.meant.includes(i) ? "meant" : "");
      circle.setAttribute("cx", place[0].toFixed(1));
      circle.setAttribute("cy", place[1].toFixed(1));
    });
  }

  /** The places in the picture of the nodes that can be dragged. */
  freePlaces(): Place[] {
    return this.nodes.flatMap((node, i): Place[] => (node.isPinned ? [] : [[this.places[2 * i]!, this.places[2 * i + 1]!]]));
  }

  /** Marks the node under a place; returns its name, null where there is none. */
  hover(place: Place | null, reach: number): string | null {
    const found = place ? nearestWithin(this.places, place[0], place[1], reach) : -1;
    if (found !== this.hovered) {
      this.hovered = found;
      this.drawn();
    }
    const node = this.nodes[found];
    return node ? this.nameOf(node) : null;
  }

  /** Those that are meant, to be meant again later. */
  get meantNodes(): readonly number[] {
    return this.meant;
  }

  mean(nodes: readonly number[]): void {
    this.meant = [...nodes];
    this.drawn();
  }

  grip(place: Place, reach: number, isAdded: boolean): Vector | null {
    const found = nearestWithin(this.places, place[0], place[1], reach);
    if (found < 0) return null;
    if (isAdded) this.meant = [...this.meant.filter((other) => other !== found), found];
    else if (!this.meant.includes(found)) this.meant = [found];
    else this.meant = [...this.meant.filter((other) => other !== found), found];
    this.drawn();
    return this.now(this.nodes[found]!.node);
  }

  /** The nodes that can be dragged, by the index that `choose` takes. */
  get choices(): { index: number; name: string }[] {
    return this.nodes.flatMap((node, index) => (node.isPinned ? [] : [{ index, name: this.nameOf(node) }]));
  }

  /** The one node that is meant; null where there is none or are several. */
  get alone(): number | null {
    return this.meant.length === 1 ? this.meant[0]! : null;
  }

  choose(index: number): void {
    this.meant = this.nodes[index]?.isPinned === false ? [index] : [];
    this.drawn();
  }

  private nameOf({ branch, position }: ControlNode): string {
    return `${this.names[branch] ?? ""} · node ${position}`;
  }

  /** The edit that bends the branch of a node about it; null where there is nothing to bend. */
  bend(index: number, axis: Vector, degrees: number): { key: string; values: Values } | null {
    const node = this.nodes[index];
    if (!node || !this.bones || !kindOf(this.state(), "skeleton")) return null;
    const branch = this.nodes.filter((other) => other.branch === node.branch).sort((a, b) => a.position - b.position);
    const held = branch.map((other) => this.held(other));
    const ways = bent(held.map(({ place }, i) => ({ place, isPinned: branch[i]!.isPinned })), branch.indexOf(node), axis, degrees);
    if (!ways) return null;
    const moves = held.reduce<Json[]>((all, { at, by }, i) => (length(ways[i]!) > 0 ? withMove(all, at, add(by, ways[i]!)) : all), this.moves());
    // Without the angle: the amount of the edit can be changed.
    return { key: "skeleton", values: { moves, name: `Bend at ${this.nameOf(node)}` } };
  }

  /** No node is meant any more; returns whether one was. */
  release(): boolean {
    const any = this.meant.length > 0;
    this.meant = [];
    if (any) this.drawn();
    return any;
  }

  center(): Vector | null {
    const node = this.nodes[this.meant.at(-1) ?? -1];
    return this.bones && node ? this.now(node.node) : null;
  }

  unit(): string {
    return lengthUnit(this.state());
  }

  begin(): Composer | null {
    const state = this.state();
    const active = this.nodes[this.meant.at(-1) ?? -1];
    if (!active || !kindOf(state, "skeleton")) return null;
    const others = this.meant.slice(0, -1).map((index) => this.held(this.nodes[index]!));
    return new NodeComposer(this.moves(), this.held(active), others, neighbours(this.nodes, active).map((node) => this.held(node)));
  }

  private held({ node }: ControlNode): Held {
    const at = pointOf(this.bones!.reference, node);
    return { at, place: this.now(node), by: this.dragOf(at) ?? [0, 0, 0] };
  }

  /** The drags that stand in the form. */
  private moves(): Json[] {
    const state = this.state();
    const { moves } = bodyOf(state.draft);
    return state.draft.key === "skeleton" && !asksNothing(state) && Array.isArray(moves) ? moves : [];
  }

  private dragOf(at: Vector): Vector | null {
    const move = this.moves().find((candidate) => isObject(candidate) && JSON.stringify(candidate.at) === JSON.stringify(at));
    return isObject(move) ? vectorOf(move.by) : null;
  }

  /** Where a node is: dragged as the form says, or as the preview has brought it. */
  private now(node: number): Vector {
    const { reference, now, preview } = this.bones!;
    const by = this.state().draft.updating === null ? this.dragOf(pointOf(reference, node)) : null;
    return by ? add(pointOf(now, node), by) : pointOf(preview ?? now, node);
  }
}

/** A gesture on nodes as the drags of a skeleton edit. */
export class NodeComposer implements Composer {
  readonly pivot: Vector;

  /**
   * `moves` are the drags that there are; `active` is the node that was gripped, `others` go with it. Where it is alone, a turn
   * turns the nodes beside it about it.
   */
  constructor(private readonly moves: readonly Json[], private readonly active: Held, private readonly others: readonly Held[], private readonly beside: readonly Held[]) {
    this.pivot = active.place;
  }

  start(lock: { kind: string }): Amount {
    return lock.kind === "ring" ? { kind: "turn", degrees: 0 } : lock.kind === "box" ? { kind: "scale", factor: 1 } : { kind: "move", by: this.active.by };
  }

  compose(lock: Parameters<Composer["compose"]>[0], amount: Amount): ReturnType<Composer["compose"]> {
    const drags: [Held, Vector][] = [];
    if (amount.kind === "move") {
      const more = subtract(amount.by, this.active.by);
      drags.push([this.active, amount.by], ...this.others.map((held): [Held, Vector] => [held, add(held.by, more)]));
    } else if (amount.kind === "turn" && lock.kind === "ring") {
      const matrix = turn(unit(lock.axis), amount.degrees);
      const around = this.others.length > 0 ? this.others : this.beside;
      drags.push([this.active, this.active.by]);
      for (const held of around) {
        const away = subtract(held.place, this.pivot);
        const way = subtract(transformed(matrix, away), away);
        // The dust of the rotation is less than what anybody means.
        const step = 10 ** (Math.floor(Math.log10(length(way) || 1)) - 9);
        drags.push([held, add(held.by, way.map((value, k) => (k === lock.axis ? 0 : toStep(value, step))) as Vector)]);
      }
    }
    const moves = drags.reduce<Json[]>((all, [held, by]) => withMove(all, held.at, by), [...this.moves]);
    // What is dragged by hand is no longer what an earlier bend was called after.
    return { key: "skeleton", values: { moves, name: null } };
  }
}
