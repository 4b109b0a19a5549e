import { expect, it } from "vitest";
import { watchDefects } from "../src/defects";

it("says what fails in the page, and not what a browser only notes", () => {
  const said: string[] = [];
  const page = new EventTarget();
  watchDefects(page as Window, (text) => said.push(text));
  const tell = (type: string, more: object): boolean => page.dispatchEvent(Object.assign(new Event(type), more));
  tell("error", { error: new TypeError("x is undefined"), message: "Uncaught TypeError" });
  tell("error", { error: null, message: "ResizeObserver loop completed with undelivered notifications." });
  tell("unhandledrejection", { reason: "gone" });
  expect(said).toEqual(["in this page, TypeError: x is undefined", "in this page, gone"]);
});
