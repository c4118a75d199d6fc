/** Actions that belong to the page alone join those of the input controller, so that one help dialog shows all. */

import { msg } from "@lit/localize";
import type { Action } from "../input/keys/action.ts";
import { OVERLAYS } from "./view/overlays.ts";
import type { Stage } from "./view/stage.ts";

export interface PageCommands {
  panel(): void;
  help(): void;
  share(): void;
  /** Opens the dialog that takes the terrain to other programs. */
  export(): void;
  /** Opens the layers of real ground, or closes them. */
  layers(): void;
  /** Opens the history, or closes it. */
  history(): void;
  /** Gives the keys back to the land. */
  toLand(): void;
  /** Goes back to now; false when that is what is shown. */
  toNow(): boolean;
  /** Puts the keys in the next part of the page, or in the one before. */
  region(back: boolean): void;
  /** Asks for an elevation file. */
  addGround(): void;
}

/** Adds the page's actions to a map of actions. */
export function pageActions(
  actions: Map<string, Action>,
  stage: Pick<Stage, "toggleStrokes" | "overlay">,
  commands: PageCommands,
): void {
  const put = (id: string, title: string, keys: string[], run: () => void): void => {
    actions.set(id, { title, keys, run, enabled: () => true });
  };
  put("toggle-strokes", msg("Show or hide all strokes"), ["s"], () => {
    stage.toggleStrokes();
  });
  put("next-overlay", msg("Next overlay: contours, steepness, detail, paint, reach, levels"), ["x"], () => {
    const at = OVERLAYS.findIndex((o) => o.value === stage.overlay.value);
    stage.overlay.value = OVERLAYS[(at + 1) % OVERLAYS.length]!.value;
  });
  put("inspector", msg("Open or close the inspector"), ["i"], commands.panel);
  put("add-ground", msg("Add real ground (an elevation file)"), ["r"], commands.addGround);
  put("layers", msg("Layers of real ground"), ["Shift+r"], commands.layers);
  put("history", msg("History of this terrain"), ["Shift+h"], commands.history);
  const cancel = actions.get("cancel");
  if (cancel)
    put("cancel", cancel.title, [...cancel.keys], () => {
      commands.toLand();
      if (!commands.toNow()) cancel.run();
    });
  put("share", msg("Share"), ["Shift+s"], commands.share);
  put("export", msg("Export for other programs"), ["Shift+e"], commands.export);
  put("next-region", msg("Keys go to the next part of the page"), ["F6"], () => commands.region(false));
  put("previous-region", msg("Keys go to the part before"), ["Shift+F6"], () => commands.region(true));
  put("help", msg("Keys and help"), ["?"], commands.help);
}
