// @vitest-environment jsdom
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import { describe, expect, it } from "vitest";
import { Camera } from "../../src/picture/camera";
import type { Box, Covered, Stand } from "../../src/picture/camera";
import { coveredBy, leaveRoomFor } from "../../src/picture/overlay";

const BOX: Box = [-0.05, 0.05, -0.5, 0.5, -0.1, 0.1];
const [WIDTH, HEIGHT] = [750, 550];

/** A camera over a picture without a browser, and where the box is seen in it, as parts of its width and height from its lower left corner. */
function picture(covered?: () => Covered) {
  const renderer = vtkRenderer.newInstance();
  const canvas = {
    getSize: () => [WIDTH, HEIGHT],
    worldToDisplay: (x: number, y: number, z: number) => {
      const [u, v, depth] = renderer.worldToNormalizedDisplay(x, y, z, WIDTH / HEIGHT) as [number, number, number];
      return [u * WIDTH, v * HEIGHT, depth];
    },
  } as unknown as vtkOpenGLRenderWindow;
  const camera = new Camera(renderer, canvas, () => BOX, () => undefined, () => undefined, covered);
  const seen = (): { across: [number, number]; down: [number, number] } => {
    const places = Array.from({ length: 8 }, (_, i) => canvas.worldToDisplay(BOX[i & 1]!, BOX[2 + ((i >> 1) & 1)]!, BOX[4 + (i >> 2)]!, renderer));
    const ends = (parts: number[]): [number, number] => [Math.min(...parts), Math.max(...parts)];
    return { across: ends(places.map(([x]) => x / WIDTH)), down: ends(places.map(([, y]) => y / HEIGHT)) };
  };
  return { camera, seen };
}

describe("the whole in the picture", () => {
  const COVERED: Covered = { left: 0, right: 0.2, top: 0.15, bottom: 0 };

  it("leaves the room that bars and tools take, and turns about its own middle all the same", () => {
    const { camera, seen } = picture(() => COVERED);
    for (const show of [() => camera.reset(), () => camera.axis(0, 1), () => camera.corner(), () => camera.fit()]) {
      show();
      const { across, down } = seen();
      expect(across[0]).toBeGreaterThan(0);
      expect(across[1]).toBeLessThan(0.8);
      expect(down[0]).toBeGreaterThan(0);
      expect(down[1]).toBeLessThan(0.85);
      // It fills what is left one way or the other.
      expect(Math.max((across[1] - across[0]) / 0.8, (down[1] - down[0]) / 0.85)).toBeGreaterThan(0.8);
      expect(camera.stand.focalPoint).toEqual([0, 0, 0]);
    }
  });

  it("is in its middle where nothing lies over it", () => {
    const { camera, seen } = picture();
    camera.reset();
    const { across, down } = seen();
    expect(across[0] + across[1]).toBeCloseTo(1, 6);
    expect(down[0] + down[1]).toBeCloseTo(1, 6);
    expect(across[1] - across[0]).toBeCloseTo(0.9, 1);
  });

  it("is seen alike in a picture that is linked, with other things over it", () => {
    const [one, other] = [picture(() => COVERED), picture()];
    one.camera.reset();
    other.camera.stand = one.camera.stand;
    one.seen().across.forEach((end, i) => expect(other.seen().across[i]).toBeCloseTo(end, 9));
    expect(other.camera.stand).toEqual(one.camera.stand);
  });
});

describe("the keys of the camera", () => {
  it("move what is seen the way that an arrow with shift points, and turn without it", () => {
    for (const parallel of [false, true]) {
      const { camera, seen } = picture();
      camera.reset();
      camera.parallel = parallel;
      const middle = (): [number, number] => { const { across, down } = seen(); return [(across[0] + across[1]) / 2, (down[0] + down[1]) / 2]; };
      const distance = ({ position, focalPoint }: Stand): number => Math.hypot(...position.map((from, k) => from - focalPoint[k]!));
      const press = (key: string, shiftKey: boolean): void => { expect(camera.key(new KeyboardEvent("keydown", { key, shiftKey }))).toBe(true); };
      for (const [key, axis, sign] of [["ArrowLeft", 0, -1], ["ArrowRight", 0, 1], ["ArrowUp", 1, 1], ["ArrowDown", 1, -1]] as const) {
        const [before, stand] = [middle(), camera.stand];
        press(key, true);
        const by = middle()[axis] - before[axis];
        expect(sign * by, key).toBeGreaterThan(0.03);
        expect(Math.abs(middle()[1 - axis]! - before[1 - axis]!), key).toBeLessThan(0.01);
        expect(distance(camera.stand)).toBeCloseTo(distance(stand), 9);
        camera.stand.viewUp.forEach((part, k) => expect(part).toBeCloseTo(stand.viewUp[k]!, 9));
      }
      const { focalPoint } = camera.stand;
      press("ArrowLeft", false);
      expect(camera.stand.focalPoint).toEqual(focalPoint);
    }
  });
});

describe("what lies over the picture", () => {
  const at = (left: number, top: number, right: number, bottom: number): HTMLElement =>
    Object.assign(document.createElement("div"), { getBoundingClientRect: () => new DOMRect(left, top, right - left, bottom - top) });
  const none = at(0, 0, 0, 0);

  it("is left free: the tools above, the bars beside", () => {
    expect(coveredBy(at(200, 50, 1000, 450), at(210, 60, 990, 100), at(840, 200, 990, 440))).toEqual({ left: 0, bottom: 0, top: 0.125, right: 0.2 });
    expect(coveredBy(at(200, 50, 1000, 450), none, none)).toEqual({ left: 0, bottom: 0, top: 0, right: 0 });
  });

  it("takes no more than there is to spare", () => {
    expect(coveredBy(at(200, 50, 1000, 150), at(210, 60, 990, 120), at(300, 60, 990, 140))).toEqual({ left: 0, bottom: 0, top: 0.4, right: 0.4 });
    expect(coveredBy(at(200, 50, 600, 450), none, at(440, 200, 590, 440)).right).toBe(0);
  });

  it("takes nothing of a picture that it stands beside", () => {
    expect(coveredBy(at(200, 50, 800, 450), none, at(812, 200, 938, 440)).right).toBe(0);
  });

  it("tells two pictures side by side how much room the bars take beside them", () => {
    const pictures = document.createElement("div");
    const told = (width: number): string => {
      leaveRoomFor(Object.defineProperty(document.createElement("div"), "offsetWidth", { value: width }), pictures);
      return pictures.style.getPropertyValue("--bars-width");
    };
    expect([told(126), told(0)]).toEqual(["150px", "0px"]);
  });
});
