// Detail synthesis: one level from its parent (docs/synthesis.md). Twin: backend/esker/synthesis/subdivide.py.
//
// A sample depends on its parent's samples, its global index and the settings alone, and work-groups are always full, so
// windows made apart agree bit for bit where they overlap.

#pragma OPENCL FP_CONTRACT OFF

#define STATE_CHANNELS 6
#define UNORM 65535.0f

// What a launch is told: Launch in backend/esker/synthesis/kernels.py.
typedef struct {
    int level, rule, cyclic, own_guide, surveyed, eroded;
    int row, col, rows, cols;                          // the child's window
    int parent_row, parent_col, parent_rows, parent_cols;
    uint seed;
    int sea, cells, shift;                             // is there a sea; 2^shift cells of the level along one side
    float spacing, relief, shore, zero, amplitude; // of the parent; elevations of share 1, and where they count from; detail * alpha * s_0
    float snow_line, tree_line, plants, tie;
    float grain, strength;                             // of the noise of h, and of the other channels
    int gully_side;                                    // of a lattice cell, samples
    float erosion, hold, wave, depth, far, margin;     // wave, depth: of the level's octave; far: distance of share 1
    int offset[SYNTH_GRIDS], side[SYNTH_GRIDS];        // of the channels' grids, in the order of Biases
} Launch;

typedef struct {
    float d, h, snow, wet, grass, forest, foam;
} State;

typedef struct {
    float height, slope_x, slope_y, concavity, guide_slope;
} Ground;

typedef struct {
    float amplitude, roughness, snow, grass, forest, wetness, survey, erosion, far;
} Biases;

uint synth_mix(uint x) {
    x ^= x >> 16;
    x *= SYNTH_HASH_MULTIPLIER_1;
    x ^= x >> 15;
    x *= SYNTH_HASH_MULTIPLIER_2;
    return x ^ (x >> 16);
}

uint synth_hash(const Launch *l, uint stream, int i, int j) {
    uint start = synth_mix(l->seed + SYNTH_HASH_STEP * (SYNTH_HASH_STREAMS * (uint)l->level + stream));
    return synth_mix(synth_mix(start + (uint)j) + (uint)i);
}

float synth_full(uint word) { return (float)(word >> 8) * 0x1p-23f - 1.0f; }
float synth_low(uint word) { return (float)(word & 0xffffu) * 0x1p-15f - (1.0f - 0x1p-16f); }
float synth_high(uint word) { return synth_low(word >> 16); }

// Stencils over p - 1 .. p + 2 at an even or odd child. Heights are large beside their differences on fine levels, so
// those are taken first, where float32 is exact (docs/synthesis.md, "Rounding").
float4 synth_spline(int odd) { return odd ? (float4)(0, 0.5f, 0.5f, 0) : (float4)(0.125f, 0.75f, 0.125f, 0); }

float synth_sum(float4 w, float4 z) { return ((w.x * z.x + w.y * z.y) + w.z * z.z) + w.w * z.w; }
float synth_first(int odd, float4 z) { return odd ? z.z - z.y : 0.5f * (z.z - z.x); }
float synth_second(int odd, float4 z) {
    return odd ? 0.5f * ((z.x - z.y) + (z.w - z.z)) : (z.x - z.y) + (z.z - z.y);
}
float synth_four_point(int odd, float4 z) {
    return odd ? z.y + (0.5f * (z.z - z.y) + 0.0625f * ((z.y - z.x) + (z.z - z.w))) : z.y;
}

// Cell of a channel's grid and place in it: exact, as both grids have powers of two cells.
float synth_place(const Launch *l, int index, int side, int *cell) {
    long scaled = (long)clamp(index, 0, l->cells) * (side - 1);
    *cell = min((int)(scaled >> l->shift), side - 2);
    return (float)(scaled - ((long)*cell << l->shift)) / (float)l->cells;
}

float synth_channel(const Launch *l, __global const float *grids, int k, int i, int j) {
    int col, row, side = l->side[k];
    float x = synth_place(l, i, side, &col), y = synth_place(l, j, side, &row);
    __global const float *at = grids + l->offset[k] + row * side + col;
    float south = at[0] * (1.0f - x) + at[1] * x;
    float north = at[side] * (1.0f - x) + at[side + 1] * x;
    return south * (1.0f - y) + north * y;
}

uint synth_unorm(float x) { return (uint)floor(0.5f + UNORM * clamp(x, 0.0f, 1.0f)); }
uint synth_pair(float low, float high) { return synth_unorm(low) | synth_unorm(high) << 16; }

uint4 synth_pack(State s) {
    return (uint4)(as_uint(s.d), synth_pair(0.5f * s.h, s.snow), synth_pair(s.wet, s.grass),
                   synth_pair(s.forest, s.foam));
}

float synth_low_half(uint word) { return (float)(word & 0xffffu); }
float synth_high_half(uint word) { return (float)(word >> 16); }

// A parent's window around a child: the first of the 4x4 samples, and the steps that stay inside of it.
typedef struct {
    int row[4], col[4];
    int odd_x, odd_y;
} Place;

Place synth_around(const Launch *l, int i, int j) {
    Place p;
    p.odd_x = i & 1, p.odd_y = j & 1;
    for (int k = 0; k < 4; k++) {
        // the fourth has no weight at an even child, and may not be there
        p.row[k] = clamp((j >> 1) - 1 + k - l->parent_row, 0, l->parent_rows - 1) * l->parent_cols;
        p.col[k] = clamp((i >> 1) - 1 + k - l->parent_col, 0, l->parent_cols - 1);
    }
    return p;
}

float4 synth_row(__global const float *z, const Place *p, int k) {
    __global const float *row = z + p->row[k];
    return (float4)(row[p->col[0]], row[p->col[1]], row[p->col[2]], row[p->col[3]]);
}

float synth_guide(__global const float *guide, const Place *p) {
    float4 rows;
    rows.x = synth_four_point(p->odd_x, synth_row(guide, p, 0));
    rows.y = synth_four_point(p->odd_x, synth_row(guide, p, 1));
    rows.z = synth_four_point(p->odd_x, synth_row(guide, p, 2));
    rows.w = synth_four_point(p->odd_x, synth_row(guide, p, 3));
    return synth_four_point(p->odd_y, rows);
}

State synth_before(__global const uint4 *state, const Place *p) {
    float4 x = synth_spline(p->odd_x), y = synth_spline(p->odd_y);
    float wx[4] = {x.x, x.y, x.z, x.w}, wy[4] = {y.x, y.y, y.z, y.w};
    State s = {0, 0, 0, 0, 0, 0, 0};
    for (int k = 0; k < 4; k++) {
        State r = {0, 0, 0, 0, 0, 0, 0};
        for (int m = 0; m < 4; m++) {
            uint4 q = state[p->row[k] + p->col[m]];
            float w = wx[m];
            r.d += w * as_float(q.x);
            r.h += w * synth_low_half(q.y);
            r.snow += w * synth_high_half(q.y);
            r.wet += w * synth_low_half(q.z);
            r.grass += w * synth_high_half(q.z);
            r.forest += w * synth_low_half(q.w);
            r.foam += w * synth_high_half(q.w);
        }
        float w = wy[k];
        s.d += w * r.d, s.h += w * r.h, s.snow += w * r.snow, s.wet += w * r.wet;
        s.grass += w * r.grass, s.forest += w * r.forest, s.foam += w * r.foam;
    }
    s.h *= 2.0f / UNORM;
    s.snow *= 1.0f / UNORM, s.wet *= 1.0f / UNORM, s.grass *= 1.0f / UNORM;
    s.forest *= 1.0f / UNORM, s.foam *= 1.0f / UNORM;
    return s;
}

// First and second differences of a surface at a child, unscaled, and its height.
typedef struct {
    float height, slope_x, slope_y, bend;
} Shape;

Shape synth_shape(const float4 rows[4], int odd_x, int odd_y) {
    float4 bx = synth_spline(odd_x), by = synth_spline(odd_y);
    float b[4], d[4], c[4];
    for (int k = 0; k < 4; k++) {
        b[k] = synth_sum(bx, rows[k]), d[k] = synth_first(odd_x, rows[k]), c[k] = synth_second(odd_x, rows[k]);
    }
    float4 west = (float4)(rows[0].x, rows[1].x, rows[2].x, rows[3].x);
    float4 here = (float4)(rows[0].y, rows[1].y, rows[2].y, rows[3].y);
    float4 east = (float4)(rows[0].z, rows[1].z, rows[2].z, rows[3].z);
    float4 last = (float4)(rows[0].w, rows[1].w, rows[2].w, rows[3].w);
    Shape s;
    s.height = synth_sum(by, (float4)(b[0], b[1], b[2], b[3]));
    s.slope_x = synth_sum(by, (float4)(d[0], d[1], d[2], d[3]));
    s.slope_y = synth_sum(bx, (float4)(synth_first(odd_y, west), synth_first(odd_y, here), synth_first(odd_y, east),
                                       synth_first(odd_y, last)));
    s.bend = synth_sum(by, (float4)(c[0], c[1], c[2], c[3])) +
             synth_sum(bx, (float4)(synth_second(odd_y, west), synth_second(odd_y, here), synth_second(odd_y, east),
                                    synth_second(odd_y, last)));
    return s;
}

Ground synth_ground(const Launch *l, __global const float *guide, __global const uint4 *state, const Place *p) {
    float4 rows[4], details[4];
    for (int k = 0; k < 4; k++) {
        __global const uint4 *row = state + p->row[k];
        rows[k] = synth_row(guide, p, k);
        details[k] = as_float4((uint4)(row[p->col[0]].x, row[p->col[1]].x, row[p->col[2]].x, row[p->col[3]].x));
    }
    Shape g = synth_shape(rows, p->odd_x, p->odd_y), d = synth_shape(details, p->odd_x, p->odd_y);
    Ground out;
    out.height = g.height + d.height;
    out.slope_x = (g.slope_x + d.slope_x) / l->spacing;
    out.slope_y = (g.slope_y + d.slope_y) / l->spacing;
    out.concavity = clamp(SYNTH_CONCAVITY_SCALE * ((g.bend + d.bend) / l->spacing), -1.0f, 1.0f);
    float gx = g.slope_x / l->spacing, gy = g.slope_y / l->spacing;
    out.guide_slope = sqrt(gx * gx + gy * gy);
    return out;
}
