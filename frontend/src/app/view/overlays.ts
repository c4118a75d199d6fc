import { msg } from "@lit/localize";
import type { Scene } from "../../core/types.ts";

/** Overlays in the order of the menu. */
export const OVERLAYS: readonly { readonly value: Scene["overlay"]; readonly label: string }[] = [
  { value: "none", label: msg("Plain ground") },
  { value: "contours", label: msg("Contour lines") },
  { value: "slope", label: msg("Steepness") },
  { value: "detail", label: msg("Roughness and amplitude") },
  { value: "snow", label: msg("Painted snow") },
  { value: "forest", label: msg("Painted forest") },
  { value: "grass", label: msg("Painted meadow") },
  { value: "wetness", label: msg("Painted wetness") },
  { value: "erosion", label: msg("Painted gullies") },
  { value: "influence", label: msg("Reach of the selected stroke") },
  { value: "patches", label: msg("Levels of detail") },
];
