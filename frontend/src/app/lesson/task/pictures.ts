/** Pictures of a task: from a file to a small WebP or PNG in base64, and back to an address that the page shows. */

import { msg } from "@lit/localize";
import { MAX_PICTURE_CHARACTERS } from "../../../generated/contract.ts";

/** Sides and qualities that are tried until a picture is small enough. */
const SIDES = [640, 480, 360, 240] as const;
const QUALITIES = [0.8, 0.6] as const;
const MAX_FILE_BYTES = 32 * 1024 * 1024;

export const NO_PICTURE = msg("This file is no picture that the browser can read.");
export const TOO_LARGE = msg("This picture is too large. Take one of 32 MB at most.");

const pngStart = "iVBORw0KGgo";

/** The address of a picture's bytes: nothing of it is run, and it cannot ask for anything. */
export function pictureUrl(picture: string): string {
  const bytes = Uint8Array.from(atob(picture), (character) => character.charCodeAt(0));
  const type = picture.startsWith(pngStart) ? "image/png" : "image/webp";
  return URL.createObjectURL(new Blob([bytes], { type }));
}

/** A picture from a file, as small as a task takes it. Rejects with a sentence. */
export async function smallPicture(file: Blob): Promise<string> {
  if (file.size > MAX_FILE_BYTES) throw new Error(TOO_LARGE);
  let bitmap: ImageBitmap;
  try {
    bitmap = await createImageBitmap(file);
  } catch {
    throw new Error(NO_PICTURE);
  }
  try {
    for (const side of SIDES)
      for (const quality of QUALITIES) {
        const text = await encoded(bitmap, side, quality);
        if (text.length <= MAX_PICTURE_CHARACTERS) return text;
      }
  } finally {
    bitmap.close();
  }
  throw new Error(msg("This picture does not become small enough. Take a plainer one."));
}

async function encoded(bitmap: ImageBitmap, side: number, quality: number): Promise<string> {
  const scale = Math.min(1, side / Math.max(bitmap.width, bitmap.height));
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(bitmap.width * scale));
  canvas.height = Math.max(1, Math.round(bitmap.height * scale));
  canvas.getContext("2d")!.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  const blob = await new Promise<Blob | null>((done) => canvas.toBlob(done, "image/webp", quality));
  const bytes = new Uint8Array((await blob?.arrayBuffer()) ?? []);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}
