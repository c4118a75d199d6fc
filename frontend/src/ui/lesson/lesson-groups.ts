import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import { memberName } from "../../app/device/names.ts";
import type { Groups } from "../../app/lesson/groups.ts";
import { MAX_GROUP_NAME, MAX_GROUPS, type Member, type PenGroup } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";
import { lessonPanelStyles } from "./styles.ts";

/** People whose pens are given and taken together: groups by name, who is in them, and one pen for each. */
export class EskLessonGroups extends SignalElement {
  static override properties = { groups: { attribute: false }, pupils: { attribute: false }, open: { state: true } };
  static override styles = [shared, panelStyles, lessonPanelStyles];

  declare groups: Groups;
  /** Who is here and may be in a group. */
  declare pupils: readonly Member[];
  /** Id of the group whose people are being chosen. */
  declare open: string | null;

  constructor() {
    super();
    this.pupils = [];
    this.open = null;
  }

  protected override render(): TemplateResult {
    const list = this.groups.list.value;
    return html`<section class="group" aria-label=${msg("Groups")}>
      <h3>${msg("Groups")}</h3>
      ${list.length === 0 ? html`<p class="quietly">${msg("Give the pen to several people at once: make a group and choose who is in it.")}</p>` : nothing}
      <ul>
        ${list.map((group) => this.#group(group))}
      </ul>
      <div class="all">
        <button class="btn outline" ?disabled=${list.length >= MAX_GROUPS} @click=${() => this.#make(list.length)}>
          ${icon("plus")} ${msg("Make a group")}
        </button>
      </div>
    </section>`;
  }

  #make(count: number): void {
    const taken = new Set(this.groups.list.peek().map(({ name }) => name));
    let number = count + 1;
    while (taken.has(msg(str`Group ${number}`))) number += 1;
    this.open = this.groups.make(msg(str`Group ${number}`)) ?? this.open;
  }

  #group(group: PenGroup): TemplateResult {
    const isOpen = this.open === group.id;
    const pen = group.pen ? msg(str`Take the pens from ${group.name}`) : msg(str`Give pens to ${group.name}`);
    const who = isOpen ? msg(str`Close ${group.name}`) : msg(str`Who is in ${group.name}`);
    return html`<li>
        <button
          class="who fold"
          aria-label=${who}
          title=${who}
          aria-expanded=${isOpen}
          @click=${() => {
            this.open = isOpen ? null : group.id;
          }}
        >
          ${group.name || msg("Without a name")} <small>${this.#count(group)}</small>
        </button>
        <button class="icon-btn pen" aria-label=${pen} title=${pen} aria-pressed=${group.pen} @click=${() => this.groups.pen(group.id, !group.pen)}>
          ${icon("pen")}
        </button>
        <button class="icon-btn" aria-label=${msg(str`Forget ${group.name}`)} title=${msg(str`Forget ${group.name}`)} @click=${() => this.#remove(group)}>
          ${icon("trash")}
        </button>
      </li>
      ${isOpen ? this.#choices(group) : nothing}`;
  }

  #count({ people }: PenGroup): string {
    const here = this.pupils.filter((member) => people.includes(member.person)).length;
    return here === people.length ? msg(str`${here} here`) : msg(str`${here} of ${people.length} here`);
  }

  #remove({ id }: PenGroup): void {
    this.groups.remove(id);
    if (this.open === id) this.open = null;
  }

  #choose({ id }: PenGroup, { person }: Member, box: HTMLInputElement): void {
    if (!box.checked) this.groups.takeOut(person, id);
    else if (!this.groups.put(person, id)) box.checked = false;
  }

  #choices(group: PenGroup): TemplateResult {
    return html`<li class="inside">
      <input
        class="field"
        aria-label=${msg("Name of the group")}
        maxlength=${MAX_GROUP_NAME}
        .value=${group.name}
        @change=${(e: Event) => this.groups.rename(group.id, (e.target as HTMLInputElement).value)}
      />
      ${this.pupils.length === 0 ? html`<p class="quietly">${msg("Nobody else is here yet")}</p>` : nothing}
      ${this.pupils.map(
        (member) => html`<label>
          <input
            type="checkbox"
            .checked=${group.people.includes(member.person)}
            @change=${(e: Event) => this.#choose(group, member, e.target as HTMLInputElement)}
          />
          <span class="spot" style=${`background:${member.colour}`}></span> ${memberName(member)}
        </label>`,
      )}
    </li>`;
  }
}

customElements.define("esk-lesson-groups", EskLessonGroups);
