/** Web Awesome draws its own icons from this page's sprite: nothing is fetched from elsewhere, nothing needs data: URLs. */

import { registerIconLibrary } from "@awesome.me/webawesome/dist/components/icon/library.js";
import { iconUrl } from "./icons.ts";

for (const library of ["default", "system"]) registerIconLibrary(library, { resolver: iconUrl, spriteSheet: true });
