/** Heights between contours that a person may choose: none of them is odd to count with. */

import { msg, str } from "@lit/localize";

export const CONTOUR_STEPS = [1, 2, 5, 10, 20, 25, 50, 100, 200, 500] as const;

/** The choice as options of a menu; 0 is automatic. */
export function contourSteps(): readonly { readonly value: number; readonly label: string }[] {
  return [
    { value: 0, label: msg("Automatic") },
    ...CONTOUR_STEPS.map((step) => ({ value: step, label: msg(str`Every ${step} m`) })),
  ];
}
