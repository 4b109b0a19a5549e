/** What happens when the browser takes the graphics away: a laptop that slept, a driver that was set back, too many pages that draw. */
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import type vtkActor from "@kitware/vtk.js/Rendering/Core/Actor";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";

interface Resources { releaseGraphicsResources(window: unknown): void }

/** Tells when a canvas can draw no more, and when it can again. */
export function watchContext(canvas: HTMLCanvasElement, told: (isLost: boolean) => void): void {
  canvas.addEventListener("webglcontextlost", (event) => {
    // Otherwise it would never be given back.
    event.preventDefault();
    told(true);
  });
  canvas.addEventListener("webglcontextrestored", () => told(false));
}

/** Lets go of all that was made in a context that is gone; what is drawn in the next one is made anew. Meanwhile nothing is complained of. */
export function releaseResources(window: vtkOpenGLRenderWindow, renderers: readonly vtkRenderer[]): void {
  for (const renderer of renderers) {
    for (const actor of renderer.getActors()) {
      const mapper = (actor as vtkActor).getMapper();
      // vtk.js lets go of its shaders alone.
      if (mapper) (window.getViewNodeFor(mapper) as unknown as Resources | undefined)?.releaseGraphicsResources(window);
    }
  }
  (window as unknown as { releaseGraphicsResources(): void }).releaseGraphicsResources();
}

/** Sets what vtk.js sets once, in a context that is another one. */
export function prepareContext(window: vtkOpenGLRenderWindow): void {
  const context = (window as unknown as { getContext(): WebGL2RenderingContext }).getContext();
  context.blendFuncSeparate(context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA, context.ONE, context.ONE_MINUS_SRC_ALPHA);
  context.depthFunc(context.LEQUAL);
}
