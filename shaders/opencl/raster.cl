// Strokes to the constraints of one level (DESIGN 5.2, 5.4, 5.5), row by row; after section.cl. Twin:
// backend/esker/solve/constraints/raster_reference.py; tables: backend/esker/solve/constraints/tables.py. One work-item does one bin of 16 x 16
// samples: per stroke the nearest crest point of every sample (of an outline among the few segments that can be nearest
// somewhere in the bin), then the stroke's cross-section, whose weighted sums do not depend on the order of edits.
#define CANDIDATES 48
#define NOTHING 0x7fffffff  // the segment of a sample that has none near
#define LANE_NUMBERS (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

// Squared distance of the bin's middle to 16 segments at once.
inline float16 middle_distance2(segments_t s, int at, float cx, float cy) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float16 ax = vload16(0, t), ay = vload16(0, t + m), dx = vload16(0, t + 2 * m), dy = vload16(0, t + 3 * m);
    float16 u = clamp(((cx - ax) * dx + (cy - ay) * dy) * vload16(0, t + 4 * m), 0.0f, 1.0f);
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

inline nearest_t nearest_of_row(int16 best, const tables_t *t, global const float *p, float16 x, float y) {
    nearest_t out = {1e15f, p[P_HEIGHT], 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 1.0f, 1e30f, 0.0f};
    for (int at = least_int16(best); at < NOTHING; at = least_int16(best)) {
        int16 mine = best == at;
        resolve(&out, mine, t->outlines, at, x, y, p[P_STOP], t->edition);
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

inline void section(sums_t *sum, const nearest_t *near, int16 in, global const float *p, const tables_t *t, int channels) {
    if (channels)
        channel_section(sum, near, in, p, t);
    else
        cross_section(sum, near, in, p, t);
}

inline void outline_in_bin(sums_t *sums, const tables_t *t, global const float *p, global const int *at, float16 x,
                           float x0, float y0, int rows, int channels) {
    int16 best[BIN];
    int reached = nearest_in_bin(best, t->outlines, at[I_FIRST], at[I_COUNT], p[P_REACH], x, x0, y0);
    if (!reached && at[I_SPANS] < 0) return;
    for (int y = 0; y < rows; y++) {
        int16 in = 0;
        nearest_t near = nearest_of_row(best[y], t, p, x, y0 + y);
        LOWER(near, t, y);
        if (at[I_SPANS] >= 0) {
            global const int *span = t->span_index + at[I_SPANS] + ((int)y0 + y - t->row0 * BIN);
            in = inside_row(t->spans, span[0], span[1], x);
        }
        section(sums + y, &near, in, p, t, channels);
    }
}

inline void clear(sums_t *sums, int rows) {
    for (int y = 0; y < rows; y++) {
        sums_t none = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
        sums[y] = none;
    }
}

// Adds the strokes `first` .. `end` - 1 that reach a bin to its sums, `rows` rows of them.
inline void gather(sums_t *sums, const tables_t *t, int bx, int by, int rows, int channels, int first, int end) {
    float x0 = bx * BIN, y0 = by * BIN;
    float16 x = x0 + (float16)LANE_NUMBERS;
    for (int i = t->row_start[by - t->row0]; i < t->row_start[by - t->row0 + 1]; i++) {
        global const int *item = t->row_items + ITEM_STRIDE * i;
        if (bx < item[1] || bx >= item[2] || item[0] < first || item[0] >= end) continue;
        global const float *p = t->strokes + STROKE_STRIDE * item[0];
        global const int *at = t->index + INDEX_STRIDE * item[0];
        if (at[I_OCTAVES] < 0) {
            outline_in_bin(sums, t, p, at, x, x0, y0, rows, channels);
            continue;
        }
        for (int y = 0; y < rows; y++) {
            nearest_t near;
            if (!straight(&near, t, p, at, x, y0 + y)) continue;
            LOWER(near, t, y);
            section(sums + y, &near, 0, p, t, channels);
        }
    }
}

// Over a base the kernels have more arguments: the base at the samples, laid out like the outputs, `share` and `target`.
#ifdef OVER_BASE
#define OVER_ARGUMENTS , global const float *base
#define OVER_SHARE , global float *share, global float *target
#define SET_OVER(t, o, width) (t).over = base + (o), (t).pitch = (width)
#else
#define OVER_ARGUMENTS
#define OVER_SHARE
#define SET_OVER(t, o, width)
#endif

// Global size (most bins of a row, rows of bins); of row by0 + j the bins windows[2 j] .. windows[2 j + 1] - 1 are done.
// Where `later` is a stroke, sums of those before it are kept for bins that have a slot: k + 1, in slot k they are; -k - 1,
// there they are to be. One loop does both parts, so that a compiler cannot round them otherwise.
// Outputs start at the tables' first bin. height_d, height_f, gradient_d: one channel; gradient_f: two.
kernel void rasterise(TABLE_ARGUMENTS, int by0, global const int *windows, int n, int pitch, int stride,
                      global float *gradient_d, global float *gradient_f, global float *height_d,
                      global float *height_f, float screening, int pinned, int later, global const int *slots,
                      global sums_t *kept OVER_ARGUMENTS OVER_SHARE) {
    int j = get_global_id(1), bx = windows[2 * j] + get_global_id(0), by = by0 + j, rows = min(BIN, n - by * BIN);
    if (bx >= windows[2 * j + 1]) return;
    tables_t t = TABLES;
    sums_t sums[BIN];
    size_t o = (size_t)(by - row0) * BIN * pitch + PAD + (bx - column0) * BIN;
    SET_OVER(t, o, pitch);
    int slot = later < NOTHING ? slots[j * get_global_size(0) + get_global_id(0)] : 0;
    global sums_t *own = kept + (size_t)(slot > 0 ? slot - 1 : slot < 0 ? -slot - 1 : 0) * BIN;
    clear(sums, rows);
    for (int y = 0; y < rows && slot > 0; y++) sums[y] = own[y];
    for (int part = slot > 0; part <= (later < NOTHING); part++) {
        gather(sums, &t, bx, by, rows, 0, part ? later : 0, part ? NOTHING : later);
        for (int y = 0; y < rows && part == 0 && slot < 0; y++) own[y] = sums[y];
    }
    int16 columns = bx * BIN + (int16)LANE_NUMBERS;
    for (int y = 0; y < rows; y++, o += pitch) {
        constraint_t c = conclude(sums + y, columns, by * BIN + y, n, screening, pinned, &t);
        vstore16(c.height_d, 0, height_d + o);
        vstore16(c.height_f, 0, height_f + o);
        vstore16(c.gradient_d, 0, gradient_d + o);
        vstore16(c.gradient_fx, 0, gradient_f + o);
        vstore16(c.gradient_fy, 0, gradient_f + stride + o);
#ifdef OVER_BASE
        vstore16(c.share, 0, share + o);
        vstore16(c.target, 0, target + o);
#endif
    }
}

// The same for one of the other channels, as differences from its base; where `covered`, f has a second channel, which
// is its cover.
kernel void rasterise_channel(TABLE_ARGUMENTS, int by0, global const int *windows, int n, int pitch, int stride,
                              global float *d, global float *f, float screening, int covered OVER_ARGUMENTS) {
    int j = get_global_id(1), bx = windows[2 * j] + get_global_id(0), by = by0 + j, rows = min(BIN, n - by * BIN);
    if (bx >= windows[2 * j + 1]) return;
    tables_t t = TABLES;
    sums_t sums[BIN];
    size_t o = (size_t)(by - row0) * BIN * pitch + PAD + (bx - column0) * BIN;
    SET_OVER(t, o, pitch);
    clear(sums, rows);
    gather(sums, &t, bx, by, rows, 1, 0, NOTHING);
    for (int y = 0; y < rows; y++, o += pitch) {
        float16 stiffness, pull, cover;
        conclude_channel(&stiffness, &pull, &cover, sums + y, screening);
        vstore16(stiffness, 0, d + o);
        vstore16(pull, 0, f + o);
        if (covered) vstore16(cover, 0, f + stride + o);
    }
}
