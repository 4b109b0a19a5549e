/** The dock below the picture: tabs, of which one is seen; folded away it is one line. */
import "./dock.css";
import { element, identifier, write } from "../dom";

export interface Tab {
  readonly title: string;
  /** What stands beside the tabs while this one is seen. */
  readonly tools: readonly HTMLElement[];
  readonly body: HTMLElement;
  /** Whether there is nothing in it yet. */
  readonly isEmpty: boolean;
  /** It is seen from now on, or no longer. */
  show(shown: boolean): void;
  /** The page has other colours. */
  recolour(): void;
}

interface Known { tab: Tab; button: HTMLButtonElement; tools: HTMLElement }

export class Dock {
  private readonly tabs: Known[] = [];
  private readonly list = element("div", { class: "tabs", role: "tablist", "aria-label": "Below the picture", onkeydown: (event) => this.key(event as KeyboardEvent) });
  private readonly toggle = element("button", { type: "button", class: "small", onclick: () => this.open(!this.isOpen) });
  private readonly bar = element("div", { class: "dock-bar" }, this.toggle, this.list);
  private chosen: Tab | null = null;
  private seen: Tab | null = null;

  /** `changed` is told whether it is open; a tab is drawn when `later` does so. */
  constructor(
    private readonly root: HTMLElement, private isOpen: boolean, private readonly changed: (isOpen: boolean) => void,
    private readonly later: (work: () => void) => void,
  ) {
    root.replaceChildren(this.bar);
  }

  add(tab: Tab): void {
    tab.body.id ||= identifier("tab-body");
    const button = element("button", { type: "button", role: "tab", id: identifier("tab"), "aria-controls": tab.body.id, onclick: () => this.choose(tab) }, tab.title);
    tab.body.setAttribute("role", "tabpanel");
    tab.body.setAttribute("aria-labelledby", button.id);
    tab.body.tabIndex = 0;
    const tools = element("div", { class: "tab-tools" }, ...tab.tools);
    this.tabs.push({ tab, button, tools });
    this.list.append(button);
    this.bar.append(tools);
    this.root.append(tab.body);
    this.chosen ??= tab;
    this.update();
  }

  /** Brings a tab to the front, and opens the dock. */
  choose(tab: Tab): void {
    this.chosen = tab;
    this.open(true);
  }

  /** Something was put into a tab, or the last of it taken away. */
  update(): void {
    this.root.hidden = this.tabs.every(({ tab }) => tab.isEmpty);
    const seen = this.isOpen && !this.root.hidden ? this.chosen : null;
    this.root.classList.toggle("open", this.isOpen);
    this.toggle.setAttribute("aria-expanded", String(this.isOpen));
    this.toggle.setAttribute("aria-label", this.isOpen ? "Fold the plots away" : "Show the plots");
    write(this.toggle, this.isOpen ? "▾" : "▸");
    for (const { tab, button, tools } of this.tabs) {
      const isChosen = tab === this.chosen;
      button.setAttribute("aria-selected", String(isChosen));
      button.tabIndex = isChosen ? 0 : -1;
      tab.body.hidden = tab !== seen;
      tools.hidden = tab !== seen;
    }
    if (seen === this.seen) return;
    const before = this.seen;
    this.seen = seen;
    before?.show(false);
    this.later(() => { if (seen === this.seen) seen?.show(true); });
  }

  /** The page has other colours. */
  recolour(): void {
    for (const { tab } of this.tabs) tab.recolour();
  }

  private open(isOpen: boolean): void {
    this.isOpen = isOpen;
    this.changed(isOpen);
    this.update();
  }

  private key(event: KeyboardEvent): void {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const at = this.tabs.findIndex(({ tab }) => tab === this.chosen);
    if (step === undefined || at < 0) return;
    event.preventDefault();
    const next = this.tabs[(at + step + this.tabs.length) % this.tabs.length]!;
    this.choose(next.tab);
    next.button.focus();
  }
}
