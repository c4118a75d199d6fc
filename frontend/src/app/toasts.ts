import { signal } from "@preact/signals-core";

export interface Toast {
  readonly id: number;
  readonly text: string;
  readonly tone: "info" | "warn";
  /** How often the same sentence came while it stood. */
  readonly times: number;
  /** The action that can be taken at once. */
  readonly act?: { readonly label: string; readonly run: () => void };
}

const SHOW_MS = 6000;
const MOST = 3;

/** Short sentences that need no answer. The same sentence again counts up instead of piling up. */
export class ToastList {
  readonly list = signal<readonly Toast[]>([]);
  readonly #timers = new Map<number, ReturnType<typeof setTimeout>>();
  #next = 1;

  show(text: string, tone: Toast["tone"] = "info", act?: Toast["act"]): void {
    const same = this.list.value.find((t) => t.text === text);
    const base: Toast = same ? { ...same, times: same.times + 1 } : { id: this.#next++, text, tone, times: 1 };
    const toast: Toast = act ? { ...base, act } : base;
    const others = this.list.value.filter((t) => t.id !== toast.id);
    const next = [...others, toast];
    for (const old of next.slice(0, -MOST)) this.#stopTimer(old.id);
    this.list.value = next.slice(-MOST);
    this.#stopTimer(toast.id);
    this.#timers.set(
      toast.id,
      setTimeout(() => this.dismiss(toast.id), SHOW_MS + 40 * text.length),
    );
  }

  dismiss(id: number): void {
    this.#stopTimer(id);
    this.list.value = this.list.value.filter((t) => t.id !== id);
  }

  dispose(): void {
    for (const timer of this.#timers.values()) clearTimeout(timer);
    this.#timers.clear();
  }

  #stopTimer(id: number): void {
    const timer = this.#timers.get(id);
    if (timer !== undefined) clearTimeout(timer);
    this.#timers.delete(id);
  }
}
