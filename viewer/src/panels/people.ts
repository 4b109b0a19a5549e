/** Who is here: their names, who steers, the wheel handed on; links for others; and the camera of the one who steers. */
import type { LinkFor, LinkTold, Person } from "../connection/protocol";
import { element, part, write } from "../dom";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import type { Kept } from "../store/kept";
import { isSteering, mayDrive, titleOf } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { sameJson } from "../store/store";

/** Names by which a browser reaches nothing but its own machine, or a tunnel that ends on it. */
const LOOPBACK = /^(localhost|127\.[\d.]+|\[::1\])$/;

/** How a link gets to the clipboard; false where the browser does not let it. */
export type Copy = (text: string) => Promise<boolean>;

export const copyToClipboard: Copy = async (text) => {
  try {
    // It is there in secure contexts only.
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
};

export class PeoplePanel {
  /** The link that was asked for last, by the id of the question. */
  private asked: string | null = null;

  constructor(
    private readonly store: Store<State, Action>, private readonly commands: Commands, private readonly kept: Pick<Kept, "name">,
    private readonly page: () => string, private readonly copy: Copy = copyToClipboard,
  ) {
    const panel = part("people");
    part("viewers").addEventListener("click", () => this.open(panel.hidden));
    part("people-close").addEventListener("click", () => this.open(false));
    panel.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      event.stopPropagation();
      this.open(false);
    });
    const name = part("own-name") as HTMLInputElement;
    name.value = kept.name;
    name.addEventListener("change", () => {
      kept.name = name.value.trim();
      name.value = kept.name;
      this.tellName();
    });
    part("follow").addEventListener("change", (event) => {
      const on = (event.target as HTMLInputElement).checked;
      if (commands.send({ follow: { on } }) !== null) store.dispatch({ type: "following", on });
      this.show(store.state);
    });
    for (const rights of ["watch", "drive"] as const) part(`link-${rights}`).addEventListener("click", () => this.ask(rights));
    part("people-list").addEventListener("click", (event) => {
      const button = (event.target as HTMLElement).closest("button");
      const client = button?.closest("li")?.dataset.client;
      if (!button || client === undefined) return;
      commands.send(button.dataset.act === "hand-over" ? { hand_over: { to: client } } : { kick: { client } });
    });
    store.watch((state) => state.connection.state === "connected" && state.hello !== null && !state.hello.recording, (is) => { if (is) this.tellName(); });
    store.watch((state) => state, (state) => this.show(state));
    store.watch((state) => [state.people, isSteering(state), state.hello?.client] as const, () => this.list(), sameJson);
  }

  /** A link has come: it goes to the clipboard, or is shown to be copied by hand. */
  async take(link: LinkTold): Promise<void> {
    if (link.id !== this.asked) return;
    const address = new URL(link.path, this.page());
    address.hash = "";
    const isCopied = await this.copy(address.toString());
    const text = part("link-text") as HTMLInputElement;
    text.hidden = isCopied;
    if (!isCopied) {
      text.value = address.toString();
      text.focus();
      text.select();
    }
    const tunnel = LOOPBACK.test(address.hostname) ? ` It leads to ${address.hostname}: elsewhere it needs a tunnel as yours.` : "";
    const rights = link.for === "watch" ? "to watch" : "and may steer";
    this.say(`${isCopied ? "Copied." : "Copy this link."} It opens one browser, once, ${rights}.${tunnel}`);
  }

  /** Whether an error was about a link of this panel. */
  refused(id: string, reason: string): boolean {
    if (id !== this.asked) return false;
    this.say(`There is no link: ${reason}.`);
    return true;
  }

  private ask(rights: LinkFor): void {
    part("link-text").hidden = true;
    this.say("");
    this.asked = this.commands.send({ link: { for: rights } });
  }

  private say(text: string): void {
    part("link-told").hidden = text === "";
    write(part("link-told"), text);
  }

  private tellName(): void {
    if (this.kept.name !== "" || this.own()?.name) this.commands.ask({ name: { name: this.kept.name } });
  }

  private own(): Person | undefined {
    const { people, hello } = this.store.state;
    return people.find(({ client }) => client === String(hello?.client));
  }

  private open(open: boolean): void {
    part("people").hidden = !open;
    part("viewers").setAttribute("aria-expanded", String(open));
    part(open ? "people" : "viewers").focus();
    // A link lets somebody in: it is not left where others may look.
    (part("link-text") as HTMLInputElement).value = "";
    part("link-text").hidden = true;
    this.say("");
  }

  private show(state: State): void {
    const watches = state.connection.state === "connected" && state.hello !== null && state.hello.role !== "driver" && !state.hello.recording && !state.end;
    part("follow-row").hidden = !watches;
    const follow = part("follow") as HTMLInputElement;
    follow.checked = state.following;
    const isThere = state.connection.state === "connected" && !state.end && state.hello !== null && !state.hello.recording;
    for (const [id, can] of [["link-watch", isThere], ["link-drive", mayDrive(state)]] as const) (part(id) as HTMLButtonElement).disabled = !can;
    part("link-drive").title = mayDrive(state) || !isThere ? "" : "This link is for watching only: it makes no link for steering.";
  }

  private list(): void {
    const { state } = this.store;
    const steers = isSteering(state);
    const list = part("people-list");
    const focused = document.activeElement as HTMLElement | null;
    const held = focused && list.contains(focused) ? { client: focused.closest("li")?.dataset.client, act: focused.dataset.act } : null;
    list.replaceChildren(...state.people.map(({ client, name, role, may_drive: may }) => {
      const isOwn = client === String(state.hello?.client);
      const about = [name ? client : null, role === "driver" ? "steers" : may ? "could steer" : "watches", isOwn ? "you" : null].filter((word) => word !== null).join(" · ");
      const title = titleOf(state, client);
      const act = (kind: string, text: string, label: string): HTMLElement =>
        element("button", { type: "button", "data-act": kind, "aria-label": `${label} ${title}` }, text);
      return element("li", { "data-client": client },
        element("span", { class: "who", title }, element("bdi", {}, name ?? `viewer ${client}`), element("small", {}, about)),
        steers && !isOwn && may ? act("hand-over", "Hand over", "Hand over to") : null,
        steers && !isOwn ? act("remove", "Remove", "Remove") : null);
    }));
    if (!held) return;
    const row = [...list.querySelectorAll("li")].find((candidate) => candidate.dataset.client === held.client);
    const again = [...row?.querySelectorAll("button") ?? []].find((button) => button.dataset.act === held.act);
    (again ?? part("people")).focus();
  }
}
