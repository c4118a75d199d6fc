// The finest level of the pyramid from the depth of the picture.
@group(2) @binding(0) var depth: texture_depth_2d;

fn depth_at(pixel: vec2u) -> f32 { return textureLoad(depth, pixel, 0); }
