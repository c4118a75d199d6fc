// Strokes to the constraints of one level (DESIGN 5.2, 5.5). Twin: backend/esker/solve/reference_raster.py; tables and
// their fields: backend/esker/solve/constraints.py. One work-item does one bin of 16 x 16 samples: per stroke it finds
// the few segments that can be nearest somewhere in the bin, then the nearest crest point of every sample, then the
// stroke's cross-section, whose weighted sums do not depend on the order of edits.
#define CANDIDATES 48
#define HALF_DIAGONAL 10.6066017f
#define TINY 1e-20f

typedef struct {
    float16 d2, height, rx, ry, along_x, along_y, left;
} nearest_t;

typedef struct {
    float16 w, wt, wa, fade, g, gx, gy, toe, hard;
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

// One segment against 16 samples of a row.
inline void consider(nearest_t *out, segments_t s, int at, float16 x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[3 * m], dy = t[4 * m], dz = t[5 * m], il2 = t[6 * m];
    float16 px = x - t[0];
    float py = y - t[m];
    float16 u = clamp((px * dx + py * dy) * il2, 0.0f, 1.0f);
    float16 rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    int16 better = d2 < out->d2;
    if (!any(better)) return;
    int16 at0 = u <= 0.0f, at1 = u >= 1.0f;
    float16 tx = select(select((float16)(dx), (float16)(t[9 * m]), at1), (float16)(t[7 * m]), at0);
    float16 ty = select(select((float16)(dy), (float16)(t[10 * m]), at1), (float16)(t[8 * m]), at0);
    float16 cross = tx * ry - ty * rx;
    int16 cap = (at0 && (int16)(t[11 * m] > 0.0f ? -1 : 0)) || (at1 && (int16)(t[12 * m] > 0.0f ? -1 : 0));
    float16 around = 0.5f + 0.5f * cross / fmax(sqrt(d2), 1e-6f);
    float16 side = select(select((float16)(0.5f), (float16)(0.0f), cross < 0.0f), (float16)(1.0f), cross > 0.0f);
    float16 along = select((float16)(dz * il2), (float16)(0.0f), cap);
    out->d2 = select(out->d2, d2, better);
    out->height = select(out->height, t[2 * m] + u * dz, better);
    out->rx = select(out->rx, rx, better);
    out->ry = select(out->ry, ry, better);
    out->along_x = select(out->along_x, along * dx, better);
    out->along_y = select(out->along_y, along * dy, better);
    out->left = select(out->left, select(side, around, cap), better);
}

// Height, fall per metre and change with the crest height of a flank (reference_raster.flank_profile).
inline void flank_profile(float16 top, float16 slope, float16 k, float16 f, float16 d, float16 *z, float16 *fall,
                          float16 *lift) {
    float16 end = (1.0f + k + f) * top / slope, safe = fmax(top, TINY);
    float16 ktop = fmax(k * top, TINY), curl = slope * slope / (4.0f * fmax(f * top, TINY)), rest = fmax(end - d, 0.0f);
    int16 shoulder = d < 2.0f * k * top / slope, foot = d > end - 2.0f * f * top / slope;
    float16 drop = slope * slope * d / (4.0f * ktop);
    *z = select((1.0f + k) * top - slope * d, top - drop * d, shoulder);
    *fall = select(slope, 2.0f * drop, shoulder);
    *lift = select(1.0f + k, 1.0f + drop * d / safe, shoulder);
    *z = select(*z, curl * rest * rest, foot);
    *fall = select(*fall, 2.0f * curl * rest, foot);
    *lift = select(*lift, 2.0f * curl * rest * (1.0f + k + f) / slope - curl * rest * rest / safe, foot);
}

// Adds one stroke's cross-section to the sums (reference_raster.cross_section). p: STROKE_FIELDS; s: metres a cell.
inline void cross_section(sums_t *sum, const nearest_t *near, int16 inside, global const float *p, float s,
                          float exit_length) {
    float16 zero = 0.0f, one = 1.0f, distance = select(sqrt(near->d2), zero, inside);
    int16 reached = inside || (near->d2 <= p[3] * p[3]);
    if (!any(reached)) return;
    float16 d = fmax(distance - p[0], 0.0f);
    int16 hard = d < CREST_HALF_WIDTH;
    float16 left = near->left * p[4], present = left + (1.0f - near->left) * p[9];
    int16 has = present > 0.0f;
    float16 share = select(zero, left / fmax(present, TINY), has);
    float16 slope = select(one, p[10] + share * (p[5] - p[10]), has), extent = p[11] + share * (p[6] - p[11]);
    float16 k = p[12] + share * (p[7] - p[12]), f = p[13] + share * (p[8] - p[13]);
    float16 top = fabs(near->height), sign = select(one, -one, near->height < 0.0f);
    float16 end = select(zero, fmin(extent, (1.0f + k + f) * top / slope), has);
    float16 r = fmin(d * s / fmax(end, THINNEST_M), 1e6f), z, fall, lift;
    flank_profile(top, slope, k, f, fmin(d * s, end), &z, &fall, &lift);
    int16 beyond = r > 1.0f;
    fall = select(fall, fmin(fall, z / exit_length), beyond);
    lift = select(select(lift, zero, beyond), one, !has);
    float16 down = select(zero, -sign * fall, has && distance > p[0]);
    float16 near_weight = 1.0f / (1.0f + d * d), inner = fmax(1.0f - r, 0.0f), outer = fmax(1.0f - r / TOE, 0.0f);
    float16 fade = present * (1.0f - smooth16((r - SPRING_FULL_FRACTION) / (1.0f - SPRING_FULL_FRACTION)));
    float16 toe = select(zero, present * (1.0f - smooth16((r - 1.0f) / (TOE - 1.0f))), has);
    fade = select(zero, select(fade, one, hard), reached);
    toe = select(zero, toe, reached);
    float16 w = near_weight * fade * select(inner * inner + TINY, one, hard), g = near_weight * toe * outer * outer;
    float16 a = SPRING_CELLS / fmax(end / s, SPRING_FLOOR_CELLS), unit = fmax(distance, 0.5f);
    float16 along_x = select(near->along_x, zero, inside), along_y = select(near->along_y, zero, inside);
    sum->w += w;
    sum->wt += w * sign * z;
    sum->wa += w * a * a;
    sum->fade = fmax(sum->fade, fade);
    sum->g += g;
    sum->gx += g * (down * near->rx / unit + lift * along_x / s);
    sum->gy += g * (down * near->ry / unit + lift * along_y / s);
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

// The nearest crest points of the whole bin; false when the stroke cannot reach it.
inline int nearest_in_bin(nearest_t *near, segments_t s, int first, int count, float reach, float x0, float y0) {
    float cx = x0 + 0.5f * (BIN - 1), cy = y0 + 0.5f * (BIN - 1), least = 1e30f;
    for (int at = first; at < first + count; at += 16) least = fmin(least, least16(middle_distance2(s, at, cx, cy)));
    least = sqrt(least);
    float bound = fmin(least + 2.0f * HALF_DIAGONAL, reach + HALF_DIAGONAL) + 1e-3f;
    for (int y = 0; y < BIN; y++) {
        near[y].d2 = 1e30f;
        near[y].height = near[y].rx = near[y].ry = near[y].along_x = near[y].along_y = near[y].left = 0.0f;
    }
    if (least > bound) return 0;
    int list[CANDIDATES], at = first;
    float16 x = x0 + (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    while (at < first + count) {
        int found = collect(list, &at, first + count, bound * bound, s, cx, cy);
        for (int y = 0; y < BIN; y++)
            for (int i = 0; i < found; i++)
                if (i == 0 || list[i] != list[i - 1]) consider(near + y, s, list[i], x, y0 + y);
    }
    return 1;
}

inline void write_row(const sums_t *sum, global float *hd, global float *hf, global float *gd, global float *gf, int x,
                      int y, int n, int stride, float screening, int pinned) {
    float16 w = fmax(sum->w, TINY), target = sum->wt / w, a = sum->wa / w * sum->fade, g = fmax(sum->g, TINY);
    int16 hard = sum->hard > 0.0f;
    float16 d = select(a, (float16)(-1.0f), hard);
    float16 f = select((a + screening * sum->fade) * target, target, hard), toe = CREST_STIFFNESS * sum->toe;
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

// Global size (bins, bins) of the dirty window, whose first bin is (bx0, by0). height_d, height_f, gradient_d: one channel; gradient_f: two.
kernel void rasterise(global const float *segments, int m, global const float *strokes, global const int *index,
                      global const int *row_start, global const int *row_items, global const int *span_index,
                      global const float *spans, global float *height_d, global float *height_f,
                      global float *gradient_d, global float *gradient_f, int n, int pitch, int stride, float spacing,
                      float screening, float exit_length, int pinned, int bx0, int by0) {
    int bx = bx0 + get_global_id(0), by = by0 + get_global_id(1);
    segments_t s = {m, segments};
    sums_t sums[BIN];
    nearest_t near[BIN];
    float x0 = bx * BIN, y0 = by * BIN;
    for (int y = 0; y < BIN; y++) {
        sums_t none = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
        sums[y] = none;
    }
    for (int i = row_start[by]; i < row_start[by + 1]; i++) {
        global const float *p = strokes + STROKE_STRIDE * row_items[i];
        global const int *at = index + INDEX_STRIDE * row_items[i];
        if (x0 > p[2] || x0 + BIN - 1 < p[1]) continue;
        int reached = nearest_in_bin(near, s, at[0], at[1], p[3], x0, y0);
        if (!reached && at[2] < 0) continue;
        float16 x = x0 + (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        for (int y = 0; y < BIN; y++) {
            int16 in = 0;
            int gy = by * BIN + y;
            if (at[2] >= 0 && gy < n) {
                in = inside_row(spans, span_index[at[2] + gy], span_index[at[2] + gy + 1], x);
                near[y].height = select(near[y].height, (float16)(segments[at[0] + 2 * (size_t)m]), in);
            }
            cross_section(sums + y, near + y, in, p, spacing, exit_length);
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
