// Strokes to the constraints of one level (DESIGN 5.2, 5.5). Twin: backend/esker/solve/reference_raster.py; tables and
// their fields: backend/esker/solve/constraints.py. One work-item does one bin of 16 x 16 samples: per stroke it finds
// the few segments that can be nearest somewhere in the bin, then the nearest crest point of every sample, then the
// stroke's cross-section, whose weighted sums do not depend on the order of edits.
#define CANDIDATES 48
#define HALF_DIAGONAL 10.6066017f
#define TINY 1e-20f
#define NOTHING 0x7fffffff  // the segment of a sample that has none near

typedef struct {
    float16 d2, height, rx, ry, along_x, along_y, left;
} nearest_t;

typedef struct {
    float16 w, wt, wa, fade, held, g, gx, gy, toe, hard;
} sums_t;

typedef struct {
    int m;                      // segments in all
    global const float *table;  // SEGMENT_FIELDS x m
} segments_t;

inline float16 smooth16(float16 t) {
    t = clamp(t, 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

// Squared distance of the bin's middle to 16 segments at once.
inline float16 middle_distance2(segments_t s, int at, float cx, float cy) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float16 ax = vload16(0, t), ay = vload16(0, t + m), dx = vload16(0, t + 3 * m), dy = vload16(0, t + 4 * m);
    float16 u = clamp(((cx - ax) * dx + (cy - ay) * dy) * vload16(0, t + 6 * m), 0.0f, 1.0f);
    float16 rx = cx - (ax + u * dx), ry = cy - (ay + u * dy);
    return rx * rx + ry * ry;
}

inline float least16(float16 v) {
    float8 a = fmin(v.lo, v.hi);
    float4 b = fmin(a.lo, a.hi);
    float2 c = fmin(b.lo, b.hi);
    return fmin(c.x, c.y);
}

inline int least_int16(int16 v) {
    int8 a = min(v.lo, v.hi);
    int4 b = min(a.lo, a.hi);
    int2 c = min(b.lo, b.hi);
    return min(c.x, c.y);
}

// Is segment `at` nearer to 16 samples of a row than what they have?
inline void consider(float16 *best2, int16 *best, segments_t s, int at, float16 x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[3 * m], dy = t[4 * m], py = y - t[m];
    float16 px = x - t[0], u = clamp((px * dx + py * dy) * t[6 * m], 0.0f, 1.0f);
    float16 rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    int16 better = d2 < *best2;
    *best2 = select(*best2, d2, better);
    *best = select(*best, (int16)(at), better);
}

// What the samples whose nearest segment is `at` need to know of their nearest crest point.
inline void resolve(nearest_t *out, int16 mine, segments_t s, int at, float16 x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[3 * m], dy = t[4 * m], dz = t[5 * m], il2 = t[6 * m], py = y - t[m];
    float16 px = x - t[0], u = clamp((px * dx + py * dy) * il2, 0.0f, 1.0f);
    float16 rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    int16 at0 = u <= 0.0f, at1 = u >= 1.0f;
    float16 tx = select(select((float16)(dx), (float16)(t[9 * m]), at1), (float16)(t[7 * m]), at0);
    float16 ty = select(select((float16)(dy), (float16)(t[10 * m]), at1), (float16)(t[8 * m]), at0);
    float16 cross = tx * ry - ty * rx;
    int16 cap = (at0 && (int16)(t[11 * m] > 0.0f ? -1 : 0)) || (at1 && (int16)(t[12 * m] > 0.0f ? -1 : 0));
    float16 side = select(select((float16)(0.5f), (float16)(0.0f), cross < 0.0f), (float16)(1.0f), cross > 0.0f);
    if (any(cap)) side = select(side, 0.5f + 0.5f * cross / fmax(sqrt(d2), 1e-6f), cap);
    float16 near0 = fmax(1.0f - 2.0f * u, 0.0f), near1 = fmax(2.0f * u - 1.0f, 0.0f);
    float16 along = (1.0f - near0 - near1) * (dz * il2);
    out->d2 = select(out->d2, d2, mine);
    out->height = select(out->height, t[2 * m] + u * dz, mine);
    out->rx = select(out->rx, rx, mine);
    out->ry = select(out->ry, ry, mine);
    out->along_x = select(out->along_x, along * dx + near0 * t[13 * m] + near1 * t[15 * m], mine);
    out->along_y = select(out->along_y, along * dy + near0 * t[14 * m] + near1 * t[16 * m], mine);
    out->left = select(out->left, side, mine);
}

inline nearest_t nearest_of_row(int16 best, segments_t s, float16 x, float y) {
    nearest_t out = {1e30f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    for (int at = least_int16(best); at < NOTHING; at = least_int16(best)) {
        int16 mine = best == at;
        resolve(&out, mine, s, at, x, y);
        best = select(best, (int16)(NOTHING), mine);
    }
    return out;
}

// Height, fall per metre and change with the crest height of a flank (reference_raster.flank_profile). `run` is 1 / slope,
// `end` the full width of the profile, d at most that.
inline void flank_profile(float16 top, float16 slope, float16 run, float16 k, float16 f, float16 end, float16 d,
                          float16 *z, float16 *fall, float16 *lift) {
    float16 half_square = 0.5f * slope * slope, rest = end - d;
    int16 shoulder = d < 2.0f * k * top * run, foot = rest < 2.0f * f * top * run;
    *z = (1.0f + k) * top - slope * d;
    *fall = slope;
    *lift = 1.0f + k;
    if (any(shoulder)) {
        float16 curve = half_square / fmax(k * top, TINY), drop = 0.5f * curve * d;
        *z = select(*z, top - drop * d, shoulder);
        *fall = select(*fall, curve * d, shoulder);
        *lift = select(*lift, 1.0f + drop * d / fmax(top, TINY), shoulder);
    }
    if (any(foot)) {
        float16 curve = half_square / fmax(f * top, TINY), low = 0.5f * curve * rest * rest;
        *z = select(*z, low, foot);
        *fall = select(*fall, curve * rest, foot);
        *lift = select(*lift, curve * rest * (1.0f + k + f) * run - low / fmax(top, TINY), foot);
    }
}

// Adds one stroke's cross-section to the sums (reference_raster.cross_section). p: STROKE_FIELDS; s: metres a cell;
// cells: 1 / s; decay: 1 / exit length.
inline void cross_section(sums_t *sum, const nearest_t *near, int16 inside, global const float *p, float s, float cells,
                          float decay) {
    float16 zero = 0.0f, one = 1.0f, distance = select(sqrt(near->d2), zero, inside);
    float16 d = fmax(distance - p[0], 0.0f), ds = d * s;
    int16 hard = d < CREST_HALF_WIDTH;
    float16 left = near->left * p[4], present = left + (1.0f - near->left) * p[9];
    int16 has = present > 0.0f;
    float16 share = left / fmax(present, TINY);
    float16 slope = select(one, p[10] + share * (p[5] - p[10]), has), extent = p[11] + share * (p[6] - p[11]);
    float16 k = p[12] + share * (p[7] - p[12]), f = p[13] + share * (p[8] - p[13]), run = 1.0f / slope;
    float16 top = fabs(near->height), full = (1.0f + k + f) * top * run, end = select(zero, fmin(extent, full), has);
    float16 wide = 1.0f / fmax(end, SPRING_FLOOR_CELLS * s), rt = ds * wide;
    int16 reached = (inside || near->d2 <= p[3] * p[3]) && (hard || (has && rt < TOE));
    if (!any(reached)) return;
    float16 r = fmin(ds / fmax(end, THINNEST_M), 1e6f), z, fall, lift;
    flank_profile(top, slope, run, k, f, full, fmin(ds, end), &z, &fall, &lift);
    float16 free = smooth16((r - SPRING_FULL_FRACTION) * (1.0f / (1.0f - SPRING_FULL_FRACTION)));
    float16 past = 1.0f + fmax(ds - end, 0.0f) * decay, cut = fmin(8.0f * (1.0f - end / fmax(full, TINY)), 1.0f);
    float16 leaving = select(free * cut, one, r > 1.0f);
    fall += leaving * (fmin(fall, EXIT_SHARE * decay * z) / (past * past) - fall);
    lift = select(select(lift, zero, r > 1.0f), one, !has);
    float16 sign = select(one, -one, near->height < 0.0f), down = select(zero, -sign * fall, has && distance > p[0]);
    float16 near_weight = 1.0f / (1.0f + d * d), inner = fmax(1.0f - r, 0.0f), outer = fmax(1.0f - rt * (1.0f / TOE), 0.0f);
    float16 fade = select(zero, select(present * (1.0f - free), one, hard), reached);
    float16 toe = select(zero, present * (1.0f - smooth16((rt - 1.0f) * (1.0f / (TOE - 1.0f)))), reached && has);
    float16 w = near_weight * fade * select(inner * inner + TINY, one, hard), g = near_weight * toe * outer * outer;
    float16 a = SPRING_CELLS * s * wide, unit = down / fmax(distance, 0.5f);
    lift = select(lift * cells, zero, inside);
    sum->w += w;
    sum->wt += w * sign * z;
    sum->wa += w * a * a;
    sum->fade = fmax(sum->fade, fade);
    float16 held = present * (1.0f - smooth16((r - HELD_FRACTION) * (1.0f / (1.0f - HELD_FRACTION))));
    sum->held = fmax(sum->held, select(zero, select(held, one, hard), reached));
    sum->g += g;
    sum->gx += g * (unit * near->rx + lift * near->along_x);
    sum->gy += g * (unit * near->ry + lift * near->along_y);
    sum->toe = fmax(sum->toe, toe);
    sum->hard = select(sum->hard, one, hard && reached);
}

inline int16 inside_row(global const float *spans, int from, int to, float16 x) {
    int16 in = 0;
    for (int i = from; i < to; i++) in = in || (x >= spans[2 * i] && x <= spans[2 * i + 1]);
    return in;
}

// Candidates of one stroke that can be nearest somewhere in the bin, from segment `at` on; returns how many.
inline int collect(int *list, int *at, int end, float bound2, segments_t s, float cx, float cy) {
    int found = 0;
    for (; *at < end && found <= CANDIDATES - 16; *at += 16) {
        float d2[16];
        vstore16(middle_distance2(s, *at, cx, cy), 0, d2);
        for (int i = 0; i < 16; i++)
            if (d2[i] <= bound2) list[found++] = *at + i;
    }
    return found;
}

// Per row of the bin the nearest segment of every sample; false when the stroke cannot reach the bin.
inline int nearest_in_bin(int16 *best, segments_t s, int first, int count, float reach, float16 x, float x0, float y0) {
    float cx = x0 + 0.5f * (BIN - 1), cy = y0 + 0.5f * (BIN - 1), least = 1e30f;
    for (int at = first; at < first + count; at += 16) least = fmin(least, least16(middle_distance2(s, at, cx, cy)));
    least = sqrt(least);
    float bound = fmin(least + 2.0f * HALF_DIAGONAL, reach + HALF_DIAGONAL) + 1e-3f;
    float16 best2[BIN];
    for (int y = 0; y < BIN; y++) {
        best2[y] = 1e30f;
        best[y] = NOTHING;
    }
    if (least > bound) return 0;
    int list[CANDIDATES], at = first;
    while (at < first + count) {
        int found = collect(list, &at, first + count, bound * bound, s, cx, cy);
        for (int y = 0; y < BIN; y++)
            for (int i = 0; i < found; i++) consider(best2 + y, best + y, s, list[i], x, y0 + y);
    }
    return 1;
}

inline void write_row(const sums_t *sum, global float *hd, global float *hf, global float *gd, global float *gf, int x,
                      int y, int n, int stride, float screening, int pinned) {
    float16 w = fmax(sum->w, TINY), target = sum->wt / w, a = sum->wa / w * sum->fade, g = fmax(sum->g, TINY);
    int16 hard = sum->hard > 0.0f;
    float16 d = select(a, (float16)(-1.0f), hard);
    float16 f = select((a + screening * sum->held) * target, target, hard), toe = CREST_STIFFNESS * sum->toe;
    if (pinned) {
        int16 at = x + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        int16 edge = at == 0 || at == n - 1 || (int16)(y == 0 || y == n - 1 ? -1 : 0);
        d = select(d, (float16)(-1.0f), edge);
        f = select(f, (float16)(0.0f), edge);
    }
    vstore16(d, 0, hd);
    vstore16(f, 0, hf);
    vstore16(toe, 0, gd);
    vstore16(toe * sum->gx / g, 0, gf);
    vstore16(toe * sum->gy / g, 0, gf + stride);
}

// Global size (most bins of a row, rows of bins); of row by0 + j the bins windows[2 j] .. windows[2 j + 1] - 1 are done. height_d, height_f, gradient_d: one channel; gradient_f: two.
kernel void rasterise(global const float *segments, int m, global const float *strokes, global const int *index,
                      global const int *row_start, global const int *row_items, global const int *span_index,
                      global const float *spans, global float *height_d, global float *height_f,
                      global float *gradient_d, global float *gradient_f, int n, int pitch, int stride, float spacing,
                      float screening, float exit_length, int pinned, int by0, global const int *windows) {
    int j = get_global_id(1), bx = windows[2 * j] + get_global_id(0), by = by0 + j;
    if (bx >= windows[2 * j + 1]) return;
    segments_t s = {m, segments};
    sums_t sums[BIN];
    int16 best[BIN];
    float x0 = bx * BIN, y0 = by * BIN;
    float16 x = x0 + (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (int y = 0; y < BIN; y++) {
        sums_t none = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
        sums[y] = none;
    }
    for (int i = row_start[by]; i < row_start[by + 1]; i++) {
        global const float *p = strokes + STROKE_STRIDE * row_items[i];
        global const int *at = index + INDEX_STRIDE * row_items[i];
        if (x0 > p[2] || x0 + BIN - 1 < p[1]) continue;
        int reached = nearest_in_bin(best, s, at[0], at[1], p[3], x, x0, y0);
        if (!reached && at[2] < 0) continue;
        for (int y = 0; y < BIN; y++) {
            int16 in = 0;
            int gy = by * BIN + y;
            nearest_t near = nearest_of_row(best[y], s, x, y0 + y);
            if (at[2] >= 0 && gy < n) {
                in = inside_row(spans, span_index[at[2] + gy], span_index[at[2] + gy + 1], x);
                near.height = select(near.height, (float16)(segments[at[0] + 2 * (size_t)m]), in);
            }
            cross_section(sums + y, &near, in, p, spacing, 1.0f / spacing, 1.0f / exit_length);
        }
    }
    for (int y = 0; y < BIN; y++) {
        int gy = by * BIN + y;
        size_t o = (size_t)gy * pitch + PAD + bx * BIN;
        if (gy < n)
            write_row(sums + y, height_d + o, height_f + o, gradient_d + o, gradient_f + o, bx * BIN, gy, n, stride,
                      screening, pinned);
    }
}
