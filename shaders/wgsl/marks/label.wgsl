// Heights on index contours: letters that stand upright to the eye along the line, hidden where the ground hides the line.
struct LabelIn {
  @location(0) place: vec4f,   // middle of the label relative to the eye, metres; w = pixels along the line to the letter
  @location(1) along: vec4f,   // direction of the line (x, y), letter in the sheet, height of a letter in pixels
};

struct LabelVertex {
  @builtin(position) position: vec4f,
  @location(0) uv: vec2f,
};

@group(1) @binding(0) var letters: texture_2d<f32>;   // r: the letter, g: the letter with its halo

const LETTERS: f32 = 16.0;      // cells side by side in the sheet
const LETTER_WIDTH: f32 = 0.75; // of its height

@vertex
fn label_vertex(@builtin(vertex_index) index: u32, in: LabelIn) -> LabelVertex {
  let corner = vec2f(f32(index & 1u), f32(index >> 1u));
  let clip = clip_of(in.place.xyz);
  let step = clip_of(in.place.xyz + vec3f(in.along.xy, 0.0) * max(length(in.place.xyz) * 0.01, 0.01));
  let pixels = 0.5 * view.viewport;
  var way = (step.xy / max(step.w, 1.0e-5) - clip.xy / max(clip.w, 1.0e-5)) * pixels;
  way = way / max(length(way), 1.0e-5);
  // Never upside down.
  if (way.x < 0.0) { way = -way; }
  let size = in.along.w;
  let at = way * (in.place.w + (corner.x - 0.5) * LETTER_WIDTH * size) + vec2f(-way.y, way.x) * (corner.y - 0.5) * size;
  // A little towards the eye, so that the ground it lies on does not cut into it.
  let near = select(1.12 * clip.z, clip.z + 0.01, view.eye.w > 0.5);
  let uv = vec2f((in.along.z + corner.x) / LETTERS, 1.0 - corner.y);
  return LabelVertex(vec4f(clip.xy + at / pixels * clip.w, min(near, clip.w), clip.w), uv);
}

@fragment
fn label_fragment(v: LabelVertex) -> @location(0) vec4f {
  let sheet = textureSampleLevel(letters, smooth_clamp, v.uv, 0.0);
  let ink = select(vec3f(0.10, 0.09, 0.08), vec3f(0.30, 0.17, 0.08), view.look == LOOK_PAPER);
  let paper = vec3f(0.97, 0.95, 0.90);
  let a = sheet.r + sheet.g * 0.72 * (1.0 - sheet.r);
  return vec4f(mix(paper, ink, sheet.r / max(a, 1.0e-3)), a);
}
