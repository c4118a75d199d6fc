/** Everything that can be done, each on a key: the toolbar, the keyboard and the help dialog read one map. */

import { msg, str } from "@lit/localize";
import type { Action, ActionContext, ActionId, Put, ToolId } from "./action.ts";
import { brushActions } from "./brushactions.ts";
import { placeActions } from "./placeactions.ts";
import { StrokeActions } from "./strokeactions.ts";

const TOOL_TITLES: Readonly<Record<ToolId, string>> = {
  select: msg("Select and shape"),
  mountain: msg("Draw mountains"),
  crevice: msg("Draw crevices"),
  plateau: msg("Draw plateaux"),
  paint: msg("Paint snow, plants, wetness and roughness"),
  course: msg("Draw rivers, roads and ridges over the ground"),
};

/** Builds the map of actions. Its owner may add more (page-only ones such as the help dialog). */
export function createActions(c: ActionContext): Map<string, Action> {
  const actions = new Map<string, Action>();
  const put = (
    id: ActionId,
    title: string,
    keys: string[],
    run: () => void,
    enabled: () => boolean = () => true,
  ): void => void actions.set(id, { title, keys, run, enabled });
  const edits = new StrokeActions(c);
  for (const [id, keys] of [
    ["select", ["v"]],
    ["mountain", ["b", "1"]],
    ["crevice", ["c", "2"]],
    ["plateau", ["p", "3"]],
    ["paint", ["k", "4"]],
    ["course", ["j", "5"]],
  ] as const)
    put(id, TOOL_TITLES[id], [...keys], () => {
      c.ruler.close();
      c.tool.value = id;
    });
  put(
    "undo",
    msg("Undo"),
    ["Ctrl+z"],
    () => edits.travel("undo"),
    () => c.canEdit() && c.doc.canUndo.value,
  );
  put(
    "redo",
    msg("Redo"),
    ["Ctrl+Shift+z", "Ctrl+y"],
    () => edits.travel("redo"),
    () => c.canEdit() && c.doc.canRedo.value,
  );
  put(
    "delete",
    msg("Delete the stroke, or the last point of what is measured"),
    ["Delete", "Backspace"],
    () => {
      if (!c.ruler.removeLast()) edits.remove();
    },
    () => (c.ruler.kind.value !== null ? c.ruler.points.value.length > 0 : edits.usable()),
  );
  for (const [kind, title, key] of [
    ["line", msg("Measure along a line: profile, distance, slope"), "y"],
    ["area", msg("Measure an area: size, volume, change"), "Shift+y"],
    ["water", msg("Follow water: a drop's way, watersheds, rain, floods"), "z"],
  ] as const)
    put(kind === "water" ? kind : `measure-${kind}`, title, [key], () => {
      if (c.placing.value !== null) return;
      if (c.ruler.kind.value === kind) c.ruler.close();
      else c.ruler.open(kind);
    });
  put("duplicate", msg("Duplicate the stroke"), ["Ctrl+d"], () => edits.duplicate(), edits.selected);
  put("mirror", msg("Swap the stroke's flanks"), ["m"], () => edits.mirror(), edits.shaped);
  put("lock", msg("Lock or unlock the stroke"), ["l"], () => edits.toggle("locked"), edits.selected);
  put("hide", msg("Hide or show the stroke"), ["h"], () => edits.toggle("hidden"), edits.usable);
  put("raise", msg("Raise the stroke"), ["PageUp"], () => edits.raise(1), edits.shaped);
  put("lower", msg("Lower the stroke"), ["PageDown"], () => edits.raise(-1), edits.shaped);
  brushActions(c, edits, put);
  put("next-stroke", msg("Select the next stroke"), ["n"], () => edits.step(1), edits.any);
  put("previous-stroke", msg("Select the previous stroke"), ["Shift+n"], () => edits.step(-1), edits.any);
  put("cancel", msg("Cancel, or select nothing"), ["Escape"], () => {
    if (c.cancel()) return;
    if (c.placing.value !== null) c.placing.value.cancel();
    else if (c.ruler.kind.value !== null) c.ruler.close();
    else c.selection.value = null;
  });
  const nudgeGrid = placeActions(c, (right, away) => edits.direction(right, away), put);
  nudgeActions(c, edits, put, nudgeGrid);
  cameraActions(c, edits, put);
  put("finger-draws", msg("One finger draws, or orbits"), ["Shift+f"], () => {
    c.fingerDraws.value = !c.fingerDraws.value;
    c.onMessage(c.fingerDraws.value ? msg("One finger draws now.") : msg("One finger moves the view now."));
  });
  return actions;
}

function nudgeActions(
  c: ActionContext,
  edits: StrokeActions,
  put: Put,
  nudgeGrid: (right: number, away: number) => boolean,
): void {
  const titles = {
    up: msg("Move the pen (or the stroke, the grid, the view) away"),
    down: msg("Move the pen (or the stroke, the grid, the view) nearer"),
    left: msg("Move the pen (or the stroke, the grid, the view) left"),
    right: msg("Move the pen (or the stroke, the grid, the view) right"),
  };
  const arrows = [
    ["up", 0, 1],
    ["down", 0, -1],
    ["left", -1, 0],
    ["right", 1, 0],
  ] as const;
  for (const [name, right, away] of arrows) {
    const key = `Arrow${name[0]!.toUpperCase()}${name.slice(1)}`;
    const title = titles[name];
    put(`nudge-${name}`, title, [key], () => {
      if (nudgeGrid(right, away)) return;
      if (edits.stroke() !== null && c.canEdit()) edits.nudge(right, away);
      else
        c.camera.pan(
          -right * c.camera.state.value.height * 0.06,
          away * c.camera.state.value.height * 0.06,
          c.ground(),
        );
    });
  }
}

function cameraActions(c: ActionContext, edits: StrokeActions, put: Put): void {
  const { camera } = c;
  put("frame-selection", msg("Look at the selection"), ["f"], () => edits.frame());
  put("north", msg("Turn the view north"), ["'"], () => camera.north());
  put("home", msg("See the whole terrain"), ["Home"], () => camera.home());
  put("camera-orbit", msg("Orbit camera"), ["o"], () => camera.setMode("orbit"));
  put("camera-fly", msg("Fly camera (W A S D, Q E)"), ["g"], () => camera.setMode("fly"));
  put("camera-map", msg("Map from above"), ["t"], () => camera.setMode("map"));
  put("zoom-in", msg("Zoom in"), ["+", "="], () => camera.zoom(1.25, undefined, true));
  put("zoom-out", msg("Zoom out"), ["-"], () => camera.zoom(0.8, undefined, true));
  put("turn-left", msg("Turn the view left"), [","], () => camera.twist(-15));
  put("turn-right", msg("Turn the view right"), ["."], () => camera.twist(15));
  for (const slot of [1, 2, 3] as const) {
    put(
      `view-${slot}`,
      msg(str`Go to view ${slot}`),
      [`Alt+${slot}`],
      () => void camera.restoreView(String(slot)),
      () => camera.views.value.has(String(slot)),
    );
    put(`save-view-${slot}`, msg(str`Remember view ${slot}`), [`Alt+Shift+${slot}`], () => {
      camera.saveView(String(slot));
      c.onMessage(msg(str`View ${slot} is remembered. Alt+${slot} brings it back.`));
    });
  }
}
