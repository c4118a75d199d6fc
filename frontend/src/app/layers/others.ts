/** Elevation files that other people bring in at this moment, for everybody to see. */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { ENDED_IMPORT, type Importing } from "../../generated/contract.ts";

/** How long the end of an import stands, and how long an import is believed of which nothing more is heard. */
const END_MS = 4000;
const SILENT_MS = 30_000;

const ENDED: ReadonlySet<string> = new Set(ENDED_IMPORT);

export class OtherImports {
  readonly #list = signal<readonly Importing[]>([]);
  readonly #timers = new Map<string, ReturnType<typeof setTimeout>>();

  get list(): ReadonlySignal<readonly Importing[]> {
    return this.#list;
  }

  receive(message: Importing): void {
    const { id, stage } = message.status;
    const known = this.#list.value.some((m) => m.status.id === id);
    // Cancelled and refused imports are nobody's news but their author's.
    if (stage === "cancelled" || stage === "refused") {
      this.#forget(id);
      return;
    }
    this.#list.value = known
      ? this.#list.value.map((m) => (m.status.id === id ? message : m))
      : [...this.#list.value, message];
    clearTimeout(this.#timers.get(id));
    this.#timers.set(
      id,
      setTimeout(() => this.#forget(id), ENDED.has(stage) ? END_MS : stage === "question" ? 20 * SILENT_MS : SILENT_MS),
    );
  }

  /** Mine has turned out to be among them. */
  leaveOut(ids: ReadonlySet<string>): void {
    for (const { status } of this.#list.peek()) if (ids.has(status.id)) this.#forget(status.id);
  }

  dispose(): void {
    for (const timer of this.#timers.values()) clearTimeout(timer);
    this.#timers.clear();
  }

  #forget(id: string): void {
    clearTimeout(this.#timers.get(id));
    this.#timers.delete(id);
    this.#list.value = this.#list.value.filter((m) => m.status.id !== id);
  }
}

/** "Ana is bringing in rainier.tif, 45 %". */
export function importingWords({ author, file, status }: Importing): string {
  const who = author || msg("Somebody");
  if (status.stage === "done") return msg(str`${who} has brought in ${file}`);
  if (status.stage === "question") return msg(str`${who} is placing ${file}`);
  return msg(str`${who} is bringing in ${file}, ${Math.round(100 * status.share)} %`);
}
