/** Web Awesome draws its own icons from this page's sprite: nothing is fetched from elsewhere, nothing needs data: URLs. */

import { registerIconLibrary } from "@awesome.me/webawesome/dist/components/icon/library.js";
import { iconUrl } from "./icons.ts";

for (const library of ["default", "system"])
  registerIconLibrary(library, {
    resolver: iconUrl,
    spriteSheet: true,
    // A drawing without proportions of its own would be 300 pixels wide: unseen, it took clicks and made dialogs scroll
    // sideways.
    mutator: (svg) => svg?.setAttribute("viewBox", "0 0 24 24"),
  });
