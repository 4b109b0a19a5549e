// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchPictureTools } from "../../src/panels/tools";
import { openDocument } from "./document";

describe("the keys of the picture", () => {
  let done: string[];
  let scene: HTMLElement;
  let isMet: boolean;
  let pinned: [number, number][];
  const press = (target: Element, key: string): boolean => !target.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  beforeEach(() => {
    openDocument();
    done = [];
    pinned = [];
    scene = document.getElementById("scene")!;
    const tool = (name: string) => () => done.push(name);
    isMet = true;
    watchPictureTools(scene, document.getElementById("stage")!, {
      pin: (x, y) => {
        done.push("pin");
        pinned.push([x, y]);
        return isMet;
      },
      unpin: tool("unpin"), use: (button) => done.push(button), save: tool("save"), movie: tool("movie"),
    });
    scene.dispatchEvent(new MouseEvent("pointermove", { bubbles: true, clientX: 5, clientY: 5 }));
  });

  it("are heard where the pointer is", () => {
    for (const key of "pmlns") expect(press(document.body, key)).toBe(true);
    expect(done).toEqual(["pin", "ruler", "line", "note", "save"]);
    scene.dispatchEvent(new MouseEvent("pointerleave"));
    press(document.body, "s");
    expect(done).toHaveLength(5);
  });

  it("pin what lies in the middle of the picture where there is no pointer, and say so where nothing does", () => {
    scene.getBoundingClientRect = () => new DOMRect(100, 50, 600, 400);
    press(scene, "p");
    scene.dispatchEvent(new MouseEvent("pointerleave"));
    press(scene, "p");
    expect(pinned).toEqual([[5, 5], [400, 250]]);
    const tip = document.getElementById("tip")!;
    expect(tip.hidden).toBe(true);
    isMet = false;
    press(scene, "p");
    expect([tip.hidden, tip.textContent, document.getElementById("announcer")!.textContent]).toEqual([false, ...Array.from({ length: 2 }, () => "Nothing lies in the middle of the picture: turn or move it there.")]);
    isMet = true;
    press(scene, "p");
    expect(tip.hidden).toBe(true);
  });

  it("are letters where somebody types, in the editor of pipelines too", () => {
    const editor = document.getElementById("pipeline-text")!.appendChild(document.createElement("div"));
    editor.className = "cm-editor";
    editor.innerHTML = '<div class="cm-content" contenteditable="true"><div class="cm-line"></div></div>';
    const places = [editor.querySelector(".cm-line")!, document.getElementById("note-text")!, document.getElementById("own-name")!, document.body.appendChild(document.createElement("select"))];
    const bare = document.body.appendChild(document.createElement("div"));
    bare.setAttribute("contenteditable", "");
    for (const place of [...places, bare]) for (const key of "slicemnp?") expect(press(place, key), key).toBe(false);
    expect(done).toEqual([]);
    // A box that is ticked takes no text.
    const box = document.body.appendChild(document.createElement("input"));
    box.type = "checkbox";
    expect(press(box, "s")).toBe(true);
  });
});
