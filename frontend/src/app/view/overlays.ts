import type { Scene } from "../../core/types.ts";

/** Overlays in the order of the menu. */
export const OVERLAYS: readonly { readonly value: Scene["overlay"]; readonly label: string }[] = [
  { value: "none", label: "Plain ground" },
  { value: "contours", label: "Contour lines" },
  { value: "slope", label: "Steepness" },
  { value: "detail", label: "Roughness and amplitude" },
  { value: "snow", label: "Painted snow" },
  { value: "forest", label: "Painted forest" },
  { value: "grass", label: "Painted meadow" },
  { value: "wetness", label: "Painted wetness" },
  { value: "erosion", label: "Painted gullies" },
  { value: "influence", label: "Reach of the selected stroke" },
  { value: "patches", label: "Levels of detail" },
];
