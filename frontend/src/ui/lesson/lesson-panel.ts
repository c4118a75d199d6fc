import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dropdown/dropdown.js";
import "@awesome.me/webawesome/dist/components/dropdown-item/dropdown-item.js";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { memberName } from "../../app/device/names.ts";
import type { LessonView } from "../../app/lesson/lesson-view.ts";
import type { Lesson, Member, People, Role } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "../controls/segmented.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";
import { lessonPanelStyles } from "./styles.ts";
import "./lesson-groups.ts";

const NAMES = [
  { value: "", label: msg("Own"), title: msg("People are called as they call themselves") },
  { value: "en", label: msg("Animals"), title: msg("Fox, Heron, Otter: typed names are neither shown nor kept") },
  { value: "de", label: "Tiere", title: msg("Fuchs, Reiher, Otter: typed names are neither shown nor kept") },
];

/** A person with one or more pages open. */
interface Person {
  readonly person: string;
  readonly member: Member;
}

/** Everything that a conductor switches, and everybody who is here. */
export class EskLessonPanel extends SignalElement {
  static override properties = {
    lesson: { attribute: false },
    members: { attribute: false },
    myRole: { attribute: false },
    client: { attribute: false },
  };
  static override styles = [shared, panelStyles, lessonPanelStyles];

  declare lesson: LessonView;
  declare members: ReadonlySignal<readonly Member[]>;
  declare myRole: ReadonlySignal<Role | null>;
  declare client: string;

  protected override render(): TemplateResult {
    const state = this.lesson.state.value;
    if (!state.conducts)
      return html`<div class="empty">${icon("user")}<p>${msg("Whoever leads this terrain finds the lesson here.")}</p></div>`;
    return html`${this.#switches(state)} ${this.#names(state)} ${this.#here(state)} ${this.#outside(state)}`;
  }

  #switches(state: Lesson): TemplateResult {
    const { lesson, client } = this;
    const shows = state.look === client;
    return html`<section class="group switches" aria-label=${msg("Switches")}>
      ${toggle(msg("Look here"), msg("Every view follows mine"), shows, () => lesson.conduct({ look: !shows }))}
      ${
        shows
          ? html`<div class="inner">
              ${toggle(msg("Nobody looks away"), "", state.held, () => lesson.conduct({ held: !state.held }))}
            </div>`
          : nothing
      }
      ${toggle(msg("Hands off"), msg("Nobody draws but who leads, or has a pen"), state.hands_off, () =>
        lesson.conduct({ hands_off: !state.hands_off }),
      )}
      ${toggle(msg("Protect"), msg("What I drew, and the settings, stay as they are"), state.protect, () =>
        lesson.conduct({ protect: !state.protect }),
      )}
    </section>`;
  }

  #names(state: Lesson): TemplateResult {
    const { lesson } = this;
    return html`<section class="group" aria-label=${msg("Names")}>
      <h3>${msg("Names")}</h3>
      <esk-segmented
        label=${msg("Names")}
        .segments=${NAMES}
        .value=${state.animals}
        @pick=${(e: CustomEvent<Lesson["animals"]>) => lesson.conduct({ animals: e.detail })}
      ></esk-segmented>
      <div class="switches">
        ${toggle(msg("Hide names"), msg("Others see neither names nor pointers"), state.hide, () => lesson.conduct({ hide: !state.hide }))}
      </div>
      <a class="quietly" href="/privacy" target="_blank">${msg("What is known of people here")}</a>
    </section>`;
  }

  #here(state: Lesson): TemplateResult {
    const people = this.#people();
    const pupils = people.filter(({ member }) => !member.conducts);
    const everybody = pupils.map(({ person }) => person);
    return html`<section class="group" aria-label=${msg("People")}>
      <h3>${people.length === 1 ? msg("Nobody else is here yet") : msg(str`${people.length} people are here`)}</h3>
      ${
        pupils.length > 1 && state.hands_off
          ? html`<div class="all">
              <button class="btn outline" @click=${() => this.lesson.pensForAll(true, everybody)}>${msg("A pen for all")}</button>
              <button class="btn outline" @click=${() => this.lesson.pensForAll(false, everybody)}>${msg("No pens")}</button>
            </div>`
          : nothing
      }
      <ul>
        ${people.map((each) => this.#person(each))}
      </ul>
    </section>
    <esk-lesson-groups
      .groups=${this.lesson.groups}
      .pupils=${pupils.map(({ member }) => member).filter(({ role }) => role === "edit")}
    ></esk-lesson-groups>`;
  }

  #people(): Person[] {
    const found = new Map<string, Person>();
    for (const member of this.members.value) {
      const known = found.get(member.person);
      if (known === undefined || member.client === this.client)
        found.set(member.person, { person: member.person, member });
    }
    return [...found.values()].sort(
      (a, b) =>
        Number(b.member.conducts) - Number(a.member.conducts) ||
        memberName(a.member).localeCompare(memberName(b.member), undefined, { numeric: true }),
    );
  }

  #person({ person, member }: Person): TemplateResult {
    const name = memberName(member);
    const mine = member.client === this.client;
    const pen = member.pen ? msg(str`Take the pen from ${name}`) : msg(str`Give a pen to ${name}`);
    const role = mine
      ? msg("you")
      : member.role === "owner"
        ? msg("owner")
        : member.conducts
          ? msg("leads")
          : member.role === "view"
            ? msg("looks")
            : "";
    return html`<li data-person=${person}>
      <span class="spot" style=${`background:${member.colour}`}></span>
      <span class="who" title=${name}>${name} ${role ? html`<small>${role}</small>` : nothing}</span>
      ${
        member.role === "edit" && !member.conducts
          ? html`<button
              class="icon-btn pen"
              aria-label=${pen}
              title=${pen}
              aria-pressed=${member.pen}
              @click=${() => this.lesson.about(member.pen ? "no_pen" : "pen", [person])}
            >
              ${icon("pen")}
            </button>`
          : nothing
      }
      ${mine ? nothing : this.#more(person, member, name)}
    </li>`;
  }

  #more(person: string, member: Member, name: string): TemplateResult {
    const owner = this.myRole.value === "owner";
    const select = (e: CustomEvent<{ item: { value: People["action"] } }>): void =>
      this.lesson.about(e.detail.item.value, [person]);
    const removable = member.role !== "owner" && (owner || !member.conducts);
    return html`<wa-dropdown placement="bottom-end" @wa-select=${select}>
      <button slot="trigger" class="icon-btn" aria-label=${msg(str`More about ${name}`)} title=${msg(str`More about ${name}`)}>${icon("ellipsis")}</button>
      <wa-dropdown-item value="undo">${msg(str`Undo all of ${name}`)}</wa-dropdown-item>
      ${
        owner && member.role === "edit"
          ? html`<wa-dropdown-item value=${member.conducts ? "no_conductor" : "conductor"}>
              ${member.conducts ? msg("Leads no more") : msg("Leads too")}
            </wa-dropdown-item>`
          : nothing
      }
      ${removable ? html`<wa-dropdown-item value="remove" variant="danger">${msg(str`Send out ${name}`)}</wa-dropdown-item>` : nothing}
    </wa-dropdown>`;
  }

  /** Who was sent out, and who waits at the door. */
  #outside(state: Lesson): TemplateResult | typeof nothing {
    const rows = [
      ...state.waiting.map((each) => ({ ...each, word: msg("waits to be let in") })),
      ...state.removed.map((each) => ({ ...each, word: msg("sent out") })),
    ];
    if (rows.length === 0) return nothing;
    return html`<section class="group" aria-label=${msg("Outside")}>
      <h3>${msg("Outside")}</h3>
      <ul>
        ${rows.map(
          (each) => html`<li data-person=${each.person}>
            <span class="who">${each.name || msg("Somebody")} <small>${each.word}</small></span>
            <button class="btn outline" @click=${() => this.lesson.about("let_in", [each.person])}>${msg("Let in")}</button>
          </li>`,
        )}
      </ul>
    </section>`;
  }
}

function toggle(label: string, hint: string, on: boolean, run: () => void): TemplateResult {
  return html`<wa-switch size="small" .checked=${live(on)} @change=${run}>
    ${label}${hint ? html`<br /><span class="quietly">${hint}</span>` : nothing}
  </wa-switch>`;
}

customElements.define("esk-lesson-panel", EskLessonPanel);
