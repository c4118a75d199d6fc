/**
 * A border round the picture inside of which triangles are not cut (a guard band), for software adapters.
 *
 * SwiftShader cuts a triangle that leaves the view at the view's border and snaps the polygon that is left to 1/16 pixel, but
 * takes which way round it lies from the whole triangle's snapped corners (SetupRoutine::generate). For slivers the two may
 * disagree, and then nothing of the polygon is drawn: pixels of the background show at the picture's border. With a viewport
 * larger than the picture only triangles longer than the border are cut in sight. Real GPUs have such a border themselves.
 */

/**
 * Slivers that are cut are seldom longer than this. The border is cheap: triangles in it are set up but fill no pixel.
 */
export const GUARD_PX = 64;

/** Width of the border for a device, pixels: none on real GPUs, and none where viewports must lie within the picture. */
export async function guardOf(device: GPUDevice, software: boolean): Promise<number> {
  if (!software) return 0;
  device.pushErrorScope("validation");
  const format = "rgba8unorm" as const;
  const target = device.createTexture({
    label: "guard",
    size: [1, 1],
    format,
    usage: GPUTextureUsage.RENDER_ATTACHMENT,
  });
  const encoder = device.createCommandEncoder();
  const pass = encoder.beginRenderPass({
    colorAttachments: [{ view: target.createView(), loadOp: "clear", storeOp: "discard" }],
  });
  pass.setViewport(-GUARD_PX, -GUARD_PX, 1 + 2 * GUARD_PX, 1 + 2 * GUARD_PX, 0, 1);
  pass.end();
  encoder.finish();
  target.destroy();
  return (await device.popErrorScope()) === null ? GUARD_PX : 0;
}
