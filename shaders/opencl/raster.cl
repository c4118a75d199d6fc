// Strokes to the constraints of one level (DESIGN 5.2, 5.5), row by row; after section.cl. Twin:
// backend/esker/solve/reference_raster.py; tables: backend/esker/solve/constraints.py. One work-item does one bin of 16 x 16 samples: per stroke it finds
// the few segments that can be nearest somewhere in the bin, then the nearest crest point of every sample, then the
// stroke's cross-section, whose weighted sums do not depend on the order of edits.
#define CANDIDATES 48
#define NOTHING 0x7fffffff  // the segment of a sample that has none near

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

inline nearest_t nearest_of_row(int16 best, segments_t s, float16 x, float y) {
    nearest_t out = {1e30f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    for (int at = least_int16(best); at < NOTHING; at = least_int16(best)) {
        int16 mine = best == at;
        resolve(&out, mine, s, at, x, y);
        best = select(best, (int16)(NOTHING), mine);
    }
    return out;
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
    int16 columns = x + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    constraint_t c = conclude(sum, columns, y, n, screening, pinned);
    vstore16(c.height_d, 0, hd);
    vstore16(c.height_f, 0, hf);
    vstore16(c.gradient_d, 0, gd);
    vstore16(c.gradient_fx, 0, gf);
    vstore16(c.gradient_fy, 0, gf + stride);
}

// Global size (most bins of a row, rows of bins); of row by0 + j the bins windows[2 j] .. windows[2 j + 1] - 1 are done.
// Tables and outputs start at bin (row0, column0) of the level. height_d, height_f, gradient_d: one channel; gradient_f:
// two.
kernel void rasterise(global const float *segments, int m, global const float *strokes, global const int *index,
                      global const int *row_start, global const int *row_items, global const int *span_index,
                      global const float *spans, global float *height_d, global float *height_f,
                      global float *gradient_d, global float *gradient_f, int n, int pitch, int stride, float spacing,
                      float screening, float exit_length, int pinned, int row0, int column0, int by0,
                      global const int *windows) {
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
    for (int i = row_start[by - row0]; i < row_start[by - row0 + 1]; i++) {
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
                global const int *span = span_index + at[2] + gy - row0 * BIN;
                in = inside_row(spans, span[0], span[1], x);
                near.height = select(near.height, (float16)(segments[at[0] + 2 * (size_t)m]), in);
            }
            cross_section(sums + y, &near, in, p, spacing, 1.0f / spacing, 1.0f / exit_length);
        }
    }
    for (int y = 0; y < BIN; y++) {
        int gy = by * BIN + y;
        size_t o = (size_t)(gy - row0 * BIN) * pitch + PAD + (bx - column0) * BIN;
        if (gy < n)
            write_row(sums + y, height_d + o, height_f + o, gradient_d + o, gradient_f + o, bx * BIN, gy, n, stride,
                      screening, pinned);
    }
}
