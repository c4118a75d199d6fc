// Stretches a picture over the canvas.
@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

struct BlitVertex {
  @builtin(position) position: vec4f,
  @location(0) uv: vec2f,
};

@vertex
fn blit_vertex(@builtin(vertex_index) index: u32) -> BlitVertex {
  let ndc = vec2f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
  return BlitVertex(vec4f(ndc, 0.0, 1.0), vec2f(ndc.x, -ndc.y) * 0.5 + 0.5);
}

@fragment
fn blit_fragment(v: BlitVertex) -> @location(0) vec4f {
  return vec4f(textureSampleLevel(picture, smooth_sampler, v.uv, 0.0).rgb, 1.0);
}
