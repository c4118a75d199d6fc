// The rules of synthesis (docs/synthesis.md) and the kernel that applies one. Twins: backend/esker/synthesis/rules/.

float synth_step(float from, float to, float x) {
    float t = clamp((x - from) / (to - from), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}
#define STEP(name, x) synth_step(SYNTH_##name##_FROM, SYNTH_##name##_TO, x)

// What the ground asks of the channels; d is unused.
State synth_targets(const Launch *l, Ground g) {
    float above_sea = g.height - l->zero, e = above_sea / l->relief;
    float t2 = g.slope_x * g.slope_x + g.slope_y * g.slope_y;
    float t = sqrt(t2), v = g.concavity, north = -g.slope_y / sqrt(1.0f + t2);
    State s;
    s.d = 0;
    s.h = SYNTH_SMOOTHNESS + SYNTH_SMOOTHNESS_FLAT * (1.0f - STEP(SMOOTHNESS_FLAT_SLOPE, t)) -
          SYNTH_SMOOTHNESS_STEEP * STEP(SMOOTHNESS_STEEP_SLOPE, t) +
          SYNTH_SMOOTHNESS_VALLEY * STEP(SMOOTHNESS_VALLEY_CONCAVITY, v) +
          SYNTH_SMOOTHNESS_LOW * (1.0f - STEP(SMOOTHNESS_LOW_ELEVATION, e));
    float line = l->snow_line - SYNTH_SNOW_NORTH * north - SYNTH_SNOW_VALLEY * v;
    s.snow = STEP(SNOW_EDGE, e - line) * (1.0f - STEP(SNOW_SLOPE, t));
    float bare = 1.0f - s.snow, tree = l->tree_line;
    s.grass = l->plants * (1.0f - STEP(GRASS_SLOPE, t)) *
              (1.0f - synth_step(tree, SYNTH_GRASS_ABOVE_TREES * tree, e)) * bare;
    s.forest = l->plants * (SYNTH_FOREST + SYNTH_FOREST_VALLEY * v) * (1.0f - STEP(FOREST_SLOPE, t)) *
               (1.0f - synth_step(SYNTH_FOREST_THINS * tree, tree, e)) * bare;
    s.wet = SYNTH_WET_VALLEY * STEP(WET_CONCAVITY, v) * (1.0f - STEP(WET_SLOPE, t));
    if (l->sea) s.wet = max(s.wet, 1.0f - STEP(WET_SHORE, above_sea / l->shore));
    s.foam = SYNTH_FOAM;
    return s;
}

float synth_blended(const Launch *l, float before, float target) { return before * (1.0f - l->tie) + target * l->tie; }

float synth_painted(float x, float bias) {
    float strength = fabs(bias);
    return x * (1.0f - strength) + (bias > 0.0f ? strength : 0.0f);
}

float synth_mixed(const Launch *l, float x, float target, float g) {
    float undecided = SYNTH_CHANNEL_NOISE_PURE + 4.0f * (1.0f - SYNTH_CHANNEL_NOISE_PURE) * target * (1.0f - target);
    return clamp(synth_blended(l, x + l->strength * g * undecided, target), 0.0f, 1.0f);
}

float synth_exponent(const Launch *l, float h, float target) {
    return clamp(synth_blended(l, h, target), SYNTH_SMOOTHNESS_MIN, SYNTH_SMOOTHNESS_MAX);
}

// Gullies (docs/synthesis.md, "Gullies"): backend/esker/synthesis/rules/gullies.py.
float synth_sine(float a) {
    float p = a * a, inner = SYNTH_GULLY_SINE_5 + p * (SYNTH_GULLY_SINE_7 + p * SYNTH_GULLY_SINE_9);
    return a * (SYNTH_GULLY_SINE_1 + p * (SYNTH_GULLY_SINE_3 + p * inner));
}

// |atan2(s, c)| / pi.
float synth_half_turns(float s, float c) {
    float high = max(fabs(s), fabs(c)), low = min(fabs(s), fabs(c));
    float x = low / max(high, 1e-20f), p = x * x;
    float inner = SYNTH_GULLY_ARC_7 + p * (SYNTH_GULLY_ARC_9 + p * SYNTH_GULLY_ARC_11);
    float a = x * (SYNTH_GULLY_ARC_1 + p * (SYNTH_GULLY_ARC_3 + p * (SYNTH_GULLY_ARC_5 + p * inner)));
    if (fabs(s) > fabs(c)) a = 0.5f - a;
    return c < 0.0f ? 1.0f - a : a;
}

float synth_rounded(float t, float radius) {
    return (sqrt(t * t + radius * radius) - radius) / (sqrt(1.0f + radius * radius) - radius);
}

float synth_gully_profile(float t) {
    float low = synth_rounded(t, SYNTH_GULLY_RIDGE), high = 1.0f - synth_rounded(1.0f - t, SYNTH_GULLY_BED);
    return SYNTH_GULLY_MIDDLE - (low * (1.0f - t) + high * t);
}

// The octave of the level for a depth of 1.
float synth_gullies(const Launch *l, Ground g, int i, int j) {
    int side = l->gully_side, cells = l->cells / side;
    int ci = (i + side) / side - 1, cj = (j + side) / side - 1;  // no index is below -side
    float u = (float)(i - ci * side) * (1.0f / (float)side), v = (float)(j - cj * side) * (1.0f / (float)side);
    float turn = 1.0f / sqrt(g.slope_x * g.slope_x + g.slope_y * g.slope_y + SYNTH_GULLY_TURN * SYNTH_GULLY_TURN);
    float nx = -g.slope_y * turn, ny = g.slope_x * turn, cosine = 0.0f, sine = 0.0f, weights = 0.0f;
    for (int k = 0; k < 9; k++) {
        int di = k % 3 - 1, dj = k / 3 - 1, a = ci + di, b = cj + dj;
        if (l->cyclic) a = (a + cells) % cells, b = (b + cells) % cells;
        uint word = synth_hash(l, SYNTH_GULLY_STREAM, a, b);
        float qx = u - ((float)di + (0.5f + SYNTH_GULLY_JITTER * synth_low(word)));
        float qy = v - ((float)dj + (0.5f + SYNTH_GULLY_JITTER * synth_high(word)));
        float w = max(0.0f, 1.0f - (qx * qx + qy * qy)), t = SYNTH_GULLY_CELL * (qx * nx + qy * ny);
        t -= floor(t + 0.5f);
        float weight = w * w;
        cosine += weight * synth_sine(0.25f - fabs(t));
        sine += weight * synth_sine(fabs(t) <= 0.25f ? t : copysign(0.5f, t) - t);
        weights += weight;
    }
    float length = sqrt(cosine * cosine + sine * sine);
    float agree = min(1.0f, length / (SYNTH_GULLY_AGREEMENT * weights + SYNTH_GULLY_AGREEMENT_LEAST));
    return agree * agree * (3.0f - 2.0f * agree) * synth_gully_profile(synth_half_turns(sine, cosine));
}

// What gullies leave of the noise of d at a sample, and how deep they are there, metres.
void synth_wear(const Launch *l, Ground g, Biases bias, float *calm, float *depth) {
    float painted = l->erosion * (1.0f + min(bias.erosion, 0.0f)) + max(bias.erosion, 0.0f), level = (float)l->level;
    float strength = min(painted, MAX_EROSION), shallow = min(strength, 1.0f);
    float steep = STEP(GULLY_FLAT, g.guide_slope) * min(g.guide_slope, SYNTH_GULLY_STEEP);
    float held = l->hold * (1.0f - STEP(GULLY_HOLD, max(0.0f, l->far * bias.far - l->margin) / l->wave));
    float back = SYNTH_GULLY_CALM_GAIN * STEP(GULLY_CALM_LEVELS, level);
    float less = (SYNTH_GULLY_CALM - back) / SYNTH_GULLY_STEEP * shallow * steep;
    *calm = (1.0f - less) * (1.0f - (1.0f - STEP(GULLY_QUIET_LEVELS, level)) * shallow * held);
    float crest = 1.0f - l->hold * STEP(GULLY_CREST, -g.concavity);
    float foot = 1.0f - SYNTH_GULLY_FOOT_SHARE * STEP(GULLY_FOOT, g.concavity);
    *depth = l->depth * strength * steep * crest * foot * (1.0f - held);
}

State synth_landscape(const Launch *l, Ground g, State before, Biases bias, int i, int j) {
    State t = synth_targets(l, g), s;
    uint words[4];
    for (uint stream = 0; stream < 4; stream++) words[stream] = synth_hash(l, stream, i, j);
    s.h = synth_exponent(l, before.h + l->grain * synth_low(words[1]), t.h);
    s.snow = synth_painted(synth_mixed(l, before.snow, t.snow, synth_high(words[1])), bias.snow);
    s.wet = synth_painted(synth_mixed(l, before.wet, t.wet, synth_low(words[2])), bias.wetness);
    s.grass = synth_painted(synth_mixed(l, before.grass, t.grass, synth_high(words[2])), bias.grass);
    s.forest = synth_painted(synth_mixed(l, before.forest, t.forest, synth_low(words[3])), bias.forest);
    s.foam = synth_mixed(l, before.foam, t.foam, synth_high(words[3]));
    float exponent = s.h + SYNTH_ROUGHNESS_TO_H * (SYNTH_BASE_ROUGHNESS - bias.roughness) + SYNTH_SNOW_TO_H * s.snow;
    float share = SYNTH_FLAT_SHARE + (1.0f - SYNTH_FLAT_SHARE) * STEP(AMPLITUDE_SLOPE, g.guide_slope);
    float amplitude = max(0.0f, l->amplitude * share + bias.amplitude);
    float size = amplitude * exp2(-(float)l->level * clamp(exponent, SYNTH_H_RANGE_FROM, SYNTH_H_RANGE_TO));
    float heard = l->surveyed ? clamp((float)l->level - bias.survey, 0.0f, 1.0f) : 1.0f;
    if (l->surveyed) size *= heard;
    if (!l->eroded) {
        s.d = before.d + size * synth_full(words[0]);
        return s;
    }
    float calm, depth;
    synth_wear(l, g, bias, &calm, &depth);
    s.d = before.d + size * calm * synth_full(words[0]);
    depth *= heard;
    if (depth != 0.0f) s.d += depth * synth_gullies(l, g, i, j);
    return s;
}

State synth_smooth(const Launch *l, Ground g, State before, Biases bias) {
    State t = synth_targets(l, g), s;
    s.d = 0;
    s.h = synth_exponent(l, before.h, t.h);
    s.snow = synth_painted(clamp(synth_blended(l, before.snow, t.snow), 0.0f, 1.0f), bias.snow);
    s.wet = synth_painted(clamp(synth_blended(l, before.wet, t.wet), 0.0f, 1.0f), bias.wetness);
    s.grass = synth_painted(clamp(synth_blended(l, before.grass, t.grass), 0.0f, 1.0f), bias.grass);
    s.forest = synth_painted(clamp(synth_blended(l, before.forest, t.forest), 0.0f, 1.0f), bias.forest);
    s.foam = clamp(synth_blended(l, before.foam, t.foam), 0.0f, 1.0f);
    return s;
}

State synth_plain(const Launch *l, Ground g, Biases bias) {
    State s = synth_targets(l, g);
    s.h = clamp(s.h, SYNTH_SMOOTHNESS_MIN, SYNTH_SMOOTHNESS_MAX);
    s.snow = synth_painted(clamp(s.snow, 0.0f, 1.0f), bias.snow);
    s.wet = synth_painted(clamp(s.wet, 0.0f, 1.0f), bias.wetness);
    s.grass = synth_painted(clamp(s.grass, 0.0f, 1.0f), bias.grass);
    s.forest = synth_painted(clamp(s.forest, 0.0f, 1.0f), bias.forest);
    return s;
}

// One item a sample of the child's window; guide and state are (rows, cols) of it. With own_guide the guide is given.
__attribute__((reqd_work_group_size(SYNTH_GROUP, 1, 1)))
__kernel void synthesise(__global const Launch *launch, __global const float *grids,
                         __global const float *parent_guide, __global const uint4 *parent_state,
                         __global float *guide, __global uint4 *state) {
    Launch l = *launch;
    int row = get_global_id(1);
    int col = min((int)get_global_id(0), l.cols - 1);  // items beyond the row go along, so that groups stay full
    int i = l.col + col, j = l.row + row;
    Place p = synth_around(&l, i, j);
    Ground ground = synth_ground(&l, parent_guide, parent_state, &p);
    State before = synth_before(parent_state, &p);
    int wi = i, wj = j;
    if (l.cyclic) {
        wi = i & (l.cells - 1), wj = j & (l.cells - 1);
    }
    Biases bias = {
        synth_channel(&l, grids, 0, wi, wj), synth_channel(&l, grids, 1, wi, wj), synth_channel(&l, grids, 2, wi, wj),
        synth_channel(&l, grids, 3, wi, wj), synth_channel(&l, grids, 4, wi, wj), synth_channel(&l, grids, 5, wi, wj),
        l.surveyed ? synth_channel(&l, grids, 6, wi, wj) : SYNTH_BASE_SURVEY,
        l.eroded ? synth_channel(&l, grids, 7, wi, wj) : 0.0f, l.eroded ? synth_channel(&l, grids, 8, wi, wj) : 1.0f,
    };
    State s;
    if (l.rule == 0) s = synth_landscape(&l, ground, before, bias, wi, wj);
    else if (l.rule == 1) s = synth_smooth(&l, ground, before, bias);
    else s = synth_plain(&l, ground, bias);
    if ((int)get_global_id(0) >= l.cols) return;
    int at = row * l.cols + col;
    state[at] = synth_pack(s);
    if (!l.own_guide) guide[at] = synth_guide(parent_guide, &p);
}
