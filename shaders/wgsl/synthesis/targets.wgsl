// What the ground asks of the channels, and the ways to follow it (docs/synthesis.md, "Targets";
// backend/esker/synthesis/rules/targets.py).
struct Targets {
  h: vec4f,
  snow: vec4f,
  wet: vec4f,
  grass: vec4f,
  forest: vec4f,
  foam: vec4f,
};

fn rise(low: f32, high: f32, x: vec4f) -> vec4f {
  let t = clamp((x - low) * (1.0 / (high - low)), vec4f(0.0), vec4f(1.0));
  return t * t * (3.0 - 2.0 * t);
}

fn targets(ground: Ground) -> Targets {
  let above_sea = ground.height - site.sea;
  let e = above_sea / site.relief;
  let t2 = ground.slope_x * ground.slope_x + ground.slope_y * ground.slope_y;
  let t = sqrt(t2);
  let north = -ground.slope_y * inverseSqrt(1.0 + t2);
  let v = ground.concavity;
  var out: Targets;
  out.h = SYNTH_SMOOTHNESS
    + SYNTH_SMOOTHNESS_FLAT * (1.0 - rise(SYNTH_SMOOTHNESS_FLAT_SLOPE_FROM, SYNTH_SMOOTHNESS_FLAT_SLOPE_TO, t))
    - SYNTH_SMOOTHNESS_STEEP * rise(SYNTH_SMOOTHNESS_STEEP_SLOPE_FROM, SYNTH_SMOOTHNESS_STEEP_SLOPE_TO, t)
    + SYNTH_SMOOTHNESS_VALLEY * rise(SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_FROM, SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_TO, v)
    + SYNTH_SMOOTHNESS_LOW * (1.0 - rise(SYNTH_SMOOTHNESS_LOW_ELEVATION_FROM, SYNTH_SMOOTHNESS_LOW_ELEVATION_TO, e));
  let above = e - (site.snow_line - SYNTH_SNOW_NORTH * north - SYNTH_SNOW_VALLEY * v);
  out.snow = rise(SYNTH_SNOW_EDGE_FROM, SYNTH_SNOW_EDGE_TO, above)
    * (1.0 - rise(SYNTH_SNOW_SLOPE_FROM, SYNTH_SNOW_SLOPE_TO, t));
  let bare = site.plants * (1.0 - out.snow);
  let tree = site.tree_line;
  out.grass = bare * (1.0 - rise(SYNTH_GRASS_SLOPE_FROM, SYNTH_GRASS_SLOPE_TO, t))
    * (1.0 - rise(tree, SYNTH_GRASS_ABOVE_TREES * tree, e));
  out.forest = bare * (SYNTH_FOREST + SYNTH_FOREST_VALLEY * v)
    * (1.0 - rise(SYNTH_FOREST_SLOPE_FROM, SYNTH_FOREST_SLOPE_TO, t)) * (1.0 - rise(SYNTH_FOREST_THINS * tree, tree, e));
  let valley = SYNTH_WET_VALLEY * rise(SYNTH_WET_CONCAVITY_FROM, SYNTH_WET_CONCAVITY_TO, v)
    * (1.0 - rise(SYNTH_WET_SLOPE_FROM, SYNTH_WET_SLOPE_TO, t));
  out.wet = max(valley, site.has_sea * (1.0 - rise(SYNTH_WET_SHORE_FROM, SYNTH_WET_SHORE_TO, above_sea / site.shore)));
  out.foam = vec4f(SYNTH_FOAM);
  return out;
}

// A channel on its way to its target.
fn blended(before: vec4f, goal: vec4f, tie: f32) -> vec4f {
  return before * (1.0 - tie) + goal * tie;
}

fn unit(x: vec4f) -> vec4f {
  return clamp(x, vec4f(0.0), vec4f(1.0));
}

fn smoothness(x: vec4f) -> vec4f {
  return clamp(x, vec4f(SYNTH_SMOOTHNESS_MIN), vec4f(SYNTH_SMOOTHNESS_MAX));
}

// A channel 0..1 under a stroke's bias: +1 makes it 1, -1 makes it 0.
fn painted(x: vec4f, bias: vec4f) -> vec4f {
  return x * (1.0 - abs(bias)) + max(bias, vec4f(0.0));
}
