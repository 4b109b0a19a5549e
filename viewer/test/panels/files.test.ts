// @vitest-environment jsdom
import { expect, it } from "vitest";
import { FilesPanel } from "../../src/panels/files";
import { page } from "../page";
import { openDocument } from "./document";

it("says why the surface cannot be saved", async () => {
  openDocument();
  const { store, commands } = page();
  new FilesPanel(store, commands, { surface: () => Promise.reject(new Error("it is torn")), content: () => null });
  [...document.querySelectorAll<HTMLButtonElement>("#files-body button")].find(({ textContent }) => textContent === "Surface (STL)")!.click();
  await new Promise((resolve) => setTimeout(resolve, 0));
  expect(store.state.refusal).toBe("The surface cannot be saved: it is torn.");
});
