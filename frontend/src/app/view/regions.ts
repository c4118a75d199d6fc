/** The focus goes from part to part of the page (F6, as on desktops), and back to the land. */

/** In the order in which F6 goes through them. */
const REGIONS = [".viewport", "aside.side", "esk-tools", "esk-view-bar", "esk-top-bar"] as const;
const FOCUSABLE = "a[href], button, input, select, textarea, summary, [tabindex]";

/** Focuses the first control of the next part that has one, or of the one before. */
export function nextRegion(root: ShadowRoot, back: boolean): void {
  const parts = REGIONS.map((s) => root.querySelector<HTMLElement>(s));
  const at = parts.findIndex((part) => part?.contains(root.activeElement) === true);
  for (let k = 1; k <= parts.length; k++) {
    const step = back ? -k : k;
    const part = parts[(Math.max(0, at) + step + parts.length) % parts.length];
    const target = part === null || part === undefined ? null : firstFocusable(part);
    if (target === null) continue;
    target.focus({ preventScroll: true });
    return;
  }
}

/** The element itself or the first inside of it, through shadow roots, that Tab would reach. */
export function firstFocusable(element: Element): HTMLElement | null {
  if (element instanceof HTMLElement && reachable(element)) return element;
  for (const child of [...(element.shadowRoot?.children ?? []), ...element.children]) {
    const found = firstFocusable(child);
    if (found !== null) return found;
  }
  return null;
}

function reachable(element: HTMLElement): boolean {
  const disabled = (element as HTMLButtonElement).disabled === true;
  return element.matches(FOCUSABLE) && !disabled && element.tabIndex >= 0 && !element.hidden;
}

/** Where the keys go, through shadow roots. */
export function deepFocus(): Element | null {
  let active = document.activeElement;
  while (active?.shadowRoot?.activeElement) active = active.shadowRoot.activeElement;
  return active;
}

/** A press on the picture takes the keys, until what it returns is called: drawing prevents the default of the pointer, so a field that had them would keep them. */
export function takesKeys(picture: HTMLElement): () => void {
  const take = (): void => {
    const active = deepFocus();
    if (active instanceof HTMLElement && active !== document.body) active.blur();
  };
  picture.addEventListener("pointerdown", take);
  return () => picture.removeEventListener("pointerdown", take);
}
