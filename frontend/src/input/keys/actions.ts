/** Everything that can be done, each on a key: the toolbar, the keyboard and the help dialog read one map. */

import type { Action, ActionContext, ActionId, Put, ToolId } from "./action.ts";
import { brushActions } from "./brushactions.ts";
import { placeActions } from "./placeactions.ts";
import { StrokeActions } from "./strokeactions.ts";

const TOOL_TITLES: Readonly<Record<ToolId, string>> = {
  select: "Select and shape",
  mountain: "Draw mountains",
  crevice: "Draw crevices",
  plateau: "Draw plateaux",
  paint: "Paint snow, plants, wetness and roughness",
  course: "Draw rivers, roads and ridges over the ground",
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
    "Undo",
    ["Ctrl+z"],
    () => edits.travel("undo"),
    () => c.canEdit() && c.doc.canUndo.value,
  );
  put(
    "redo",
    "Redo",
    ["Ctrl+Shift+z", "Ctrl+y"],
    () => edits.travel("redo"),
    () => c.canEdit() && c.doc.canRedo.value,
  );
  put(
    "delete",
    "Delete the stroke, or the last point of what is measured",
    ["Delete", "Backspace"],
    () => {
      if (!c.ruler.removeLast()) edits.remove();
    },
    () => (c.ruler.kind.value !== null ? c.ruler.points.value.length > 0 : edits.usable()),
  );
  for (const [kind, title, key] of [
    ["line", "Measure along a line: profile, distance, slope", "y"],
    ["area", "Measure an area: size, volume, change", "Shift+y"],
    ["water", "Follow water: a drop's way, watersheds, rain, floods", "z"],
  ] as const)
    put(kind === "water" ? kind : `measure-${kind}`, title, [key], () => {
      if (c.placing.value !== null) return;
      if (c.ruler.kind.value === kind) c.ruler.close();
      else c.ruler.open(kind);
    });
  put("duplicate", "Duplicate the stroke", ["Ctrl+d"], () => edits.duplicate(), edits.selected);
  put("mirror", "Swap the stroke's flanks", ["m"], () => edits.mirror(), edits.shaped);
  put("lock", "Lock or unlock the stroke", ["l"], () => edits.toggle("locked"), edits.selected);
  put("hide", "Hide or show the stroke", ["h"], () => edits.toggle("hidden"), edits.usable);
  put("raise", "Raise the stroke", ["PageUp"], () => edits.raise(1), edits.shaped);
  put("lower", "Lower the stroke", ["PageDown"], () => edits.raise(-1), edits.shaped);
  brushActions(c, edits, put);
  put("next-stroke", "Select the next stroke", ["n"], () => edits.step(1), edits.any);
  put("previous-stroke", "Select the previous stroke", ["Shift+n"], () => edits.step(-1), edits.any);
  put("cancel", "Cancel, or select nothing", ["Escape"], () => {
    if (c.cancel()) return;
    if (c.placing.value !== null) c.placing.value.cancel();
    else if (c.ruler.kind.value !== null) c.ruler.close();
    else c.selection.value = null;
  });
  const nudgeGrid = placeActions(c, (right, away) => edits.direction(right, away), put);
  nudgeActions(c, edits, put, nudgeGrid);
  cameraActions(c, edits, put);
  put("finger-draws", "One finger draws, or orbits", ["Shift+f"], () => {
    c.fingerDraws.value = !c.fingerDraws.value;
    c.onMessage(c.fingerDraws.value ? "One finger draws now." : "One finger moves the view now.");
  });
  return actions;
}

function nudgeActions(
  c: ActionContext,
  edits: StrokeActions,
  put: Put,
  nudgeGrid: (right: number, away: number) => boolean,
): void {
  const arrows = [
    ["up", 0, 1],
    ["down", 0, -1],
    ["left", -1, 0],
    ["right", 1, 0],
  ] as const;
  for (const [name, right, away] of arrows) {
    const key = `Arrow${name[0]!.toUpperCase()}${name.slice(1)}`;
    const title = `Move the pen (or the stroke, the grid, the view) ${{ up: "away", down: "nearer", left: "left", right: "right" }[name]}`;
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
  put("frame-selection", "Look at the selection", ["f"], () => edits.frame());
  put("north", "Turn the view north", ["'"], () => camera.north());
  put("home", "See the whole terrain", ["Home"], () => camera.home());
  put("camera-orbit", "Orbit camera", ["o"], () => camera.setMode("orbit"));
  put("camera-fly", "Fly camera (W A S D, Q E)", ["g"], () => camera.setMode("fly"));
  put("camera-map", "Map from above", ["t"], () => camera.setMode("map"));
  put("zoom-in", "Zoom in", ["+", "="], () => camera.zoom(1.25, undefined, true));
  put("zoom-out", "Zoom out", ["-"], () => camera.zoom(0.8, undefined, true));
  put("turn-left", "Turn the view left", [","], () => camera.twist(-15));
  put("turn-right", "Turn the view right", ["."], () => camera.twist(15));
  for (const slot of [1, 2, 3] as const) {
    put(
      `view-${slot}`,
      `Go to view ${slot}`,
      [`Alt+${slot}`],
      () => void camera.restoreView(String(slot)),
      () => camera.views.value.has(String(slot)),
    );
    put(`save-view-${slot}`, `Remember view ${slot}`, [`Alt+Shift+${slot}`], () => {
      camera.saveView(String(slot));
      c.onMessage(`View ${slot} is remembered. Alt+${slot} brings it back.`);
    });
  }
}
