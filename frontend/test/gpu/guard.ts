/** Which pixels the device fills of triangles that leave the view: with the border of gpu/passes/guard.ts and without. */

import { createPass, GrowingBuffer, type PassContext } from "../../src/gpu/passes/pipeline.ts";
import { VIEW_SOURCE } from "../../src/gpu/shaders.ts";
import { makeWorld, sceneOf, sharedRig } from "./crackrig.ts";
import { HEIGHT, WIDTH } from "./cracktally.ts";
import { FieldView, mapCamera } from "./world.ts";

const TRIANGLES = /* wgsl */ `
override WIDE: u32 = 1u;

@vertex
fn corner_vertex(@location(0) corner: vec4f) -> @builtin(position) vec4f {
  return select(corner, guarded(corner), WIDE == 1u);
}

@fragment
fn corner_fragment() -> @location(0) vec4f { return vec4f(1.0); }
`;

/**
 * Draws triangles as patches are drawn. `corners`: clip positions of the picture, four numbers each; `wide`: with the
 * border. Pixels that are filled: column, row.
 */
export async function guardTest(corners: readonly number[], wide: boolean): Promise<[number, number][]> {
  const rig = await sharedRig();
  const view = new FieldView(4096, 0, () => 0);
  const world = makeWorld(rig, view);
  const scene = sceneOf(view, mapCamera([2048, 2048, 0], 500, WIDTH, HEIGHT), "paper");
  rig.frame.update(scene, { width: WIDTH, height: HEIGHT, low: 0, high: 0 });
  const context: PassContext = {
    device: rig.device,
    frameLayout: rig.frame.layout,
    format: "r8unorm",
    samples: 1,
    detail: "plain",
  };
  const attributes: GPUVertexAttribute[] = [{ shaderLocation: 0, offset: 0, format: "float32x4" }];
  const pipeline = await createPass(context, {
    label: "corners",
    code: VIEW_SOURCE + TRIANGLES,
    vertex: "corner_vertex",
    fragment: "corner_fragment",
    buffers: [{ arrayStride: 16, attributes }],
    vertexConstants: { WIDE: wide ? 1 : 0 },
  });
  const buffer = new GrowingBuffer(rig.device, "corners");
  const vertices = buffer.write(Float32Array.from(corners), corners.length);
  const pixels = new Uint8Array(
    await rig.one.draw(rig.device.createCommandEncoder(), rig.depth, (pass) => {
      pass.setBindGroup(0, rig.frame.bindGroup);
      if (wide) rig.frame.widen(pass);
      pass.setPipeline(pipeline);
      pass.setVertexBuffer(0, vertices);
      pass.draw(corners.length / 4);
    }),
  );
  buffer.destroy();
  world.atlas.destroy();
  const filled: [number, number][] = [];
  for (let at = 0; at < pixels.length; at += 1) if (pixels[at] !== 0) filled.push([at % WIDTH, Math.floor(at / WIDTH)]);
  return filled;
}
