// The finest level of the pyramid from the depth of the picture, four samples a pixel.
@group(2) @binding(0) var depth: texture_depth_multisampled_2d;

fn depth_at(pixel: vec2u) -> f32 {
  return min(
    min(textureLoad(depth, pixel, 0), textureLoad(depth, pixel, 1)),
    min(textureLoad(depth, pixel, 2), textureLoad(depth, pixel, 3)),
  );
}
