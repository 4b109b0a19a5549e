// @vitest-environment jsdom
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import { expect, it } from "vitest";
import { prepareContext, releaseResources, watchContext } from "../../src/picture/lost-context";

it("a context that is lost is asked back, and both are told", () => {
  const told: boolean[] = [];
  const canvas = document.createElement("canvas");
  watchContext(canvas, (isLost) => told.push(isLost));
  const lost = new Event("webglcontextlost", { cancelable: true });
  canvas.dispatchEvent(lost);
  // Browsers give back only what was asked for in this way.
  expect([lost.defaultPrevented, told]).toEqual([true, [true]]);
  canvas.dispatchEvent(new Event("webglcontextrestored"));
  expect(told).toEqual([true, false]);
});

it("all that was made in a context is let go of, the mappers' buffers among it", () => {
  const released: unknown[] = [];
  const window = {
    getViewNodeFor: (mapper: string) => (mapper === "never drawn" ? undefined : { releaseGraphicsResources: (of: unknown) => released.push([mapper, of === window]) }),
    releaseGraphicsResources: () => released.push("shaders"),
  };
  const renderer = (...mappers: (string | null)[]) => ({ getActors: () => mappers.map((mapper) => ({ getMapper: () => mapper })) });
  releaseResources(window as unknown as vtkOpenGLRenderWindow, [renderer("surface", null), renderer("never drawn", "bones")] as unknown as vtkRenderer[]);
  expect(released).toEqual([["surface", true], ["bones", true], "shaders"]);
});

it("a context that is given back blends and hides as the first one did", () => {
  const set: unknown[] = [];
  const context = { SRC_ALPHA: 1, ONE_MINUS_SRC_ALPHA: 2, ONE: 3, LEQUAL: 4, blendFuncSeparate: (...how: number[]) => set.push(how), depthFunc: (how: number) => set.push(how) };
  prepareContext({ getContext: () => context } as unknown as vtkOpenGLRenderWindow);
  expect(set).toEqual([[1, 2, 3, 2], 4]);
});
