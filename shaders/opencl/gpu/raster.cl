// Strokes to the constraints of one level on a GPU (DESIGN 5.2, 5.5); after section.cl, scalar. Twin:
// backend/esker/solve/constraints/raster_reference.py. A work-group of 16 x 16 does one bin: together its work-items find the least
// distance of a stroke to the bin's middle and mark the segments that can be nearest somewhere in the bin, a bit each, so
// that every one then tries them in the order of the table, whichever work-item found them: ties fall as on a CPU.
#define NOTHING 0x7fffffff  // the segment of a sample that has none near
#define BIN_ITEMS (BIN * BIN)

// Squared distance of a point to a segment.
inline float distance2(segments_t s, int at, float x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[2 * m], dy = t[3 * m], u = clamp(((x - t[0]) * dx + (y - t[m]) * dy) * t[4 * m], 0.0f, 1.0f);
    float rx = x - (t[0] + u * dx), ry = y - (t[m] + u * dy);
    return rx * rx + ry * ry;
}

// Nearest segment of this work-item's sample; false when the stroke cannot reach the bin. least and marks are the
// work-group's; floats above zero compare like their bits.
inline int nearest_in_bin(int *best, segments_t s, int first, int count, float reach, float x, float y, float cx, float cy,
                          local int *least_bits, local uint *marks) {
    int lid = get_local_id(1) * BIN + get_local_id(0);
    float best2 = 1e30f, mine = 1e30f;
    *best = NOTHING;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lid == 0) *least_bits = as_int(1e30f);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int at = first + lid; at < first + count; at += BIN_ITEMS) mine = fmin(mine, distance2(s, at, cx, cy));
    if (mine < 1e30f) atomic_min(least_bits, as_int(mine));
    barrier(CLK_LOCAL_MEM_FENCE);
    float least = sqrt(as_float(*least_bits));
    float bound = fmin(least + 2.0f * HALF_DIAGONAL, reach + HALF_DIAGONAL) + 1e-3f;
    if (least > bound) return 0;
    for (int from = first; from < first + count; from += BIN_ITEMS) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (lid < BIN_ITEMS / 32) marks[lid] = 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        int at = from + lid;
        if (at < first + count && distance2(s, at, cx, cy) <= bound * bound) atomic_or(marks + lid / 32, 1u << (lid % 32));
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int w = 0; w < BIN_ITEMS / 32; w++)
            for (uint left = marks[w]; left; left &= left - 1)
                consider(&best2, best, s, from + 32 * w + 31 - (int)clz(left & -left), x, y);
    }
    return 1;
}

// The sums of all strokes at this work-item's sample; (x0, y0): the bin's first.
inline sums_t gather(const tables_t *t, int bx, int by, int gx, int gy, int n, local int *least_bits, local uint *marks,
                     int channels) {
    sums_t sum = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    float x = gx, y = gy, cx = bx * BIN + 0.5f * (BIN - 1), cy = by * BIN + 0.5f * (BIN - 1);
    for (int i = t->row_start[by - t->row0]; i < t->row_start[by - t->row0 + 1]; i++) {
        global const int *item = t->row_items + ITEM_STRIDE * i;
        if (bx < item[1] || bx >= item[2]) continue;
        global const float *p = t->strokes + STROKE_STRIDE * item[0];
        global const int *at = t->index + INDEX_STRIDE * item[0];
        nearest_t near = {1e15f, p[P_HEIGHT], 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 1.0f, 1e30f, 0.0f};
        int in = 0, reached;
        if (at[I_OCTAVES] < 0) {
            int best;
            reached = nearest_in_bin(&best, t->outlines, at[I_FIRST], at[I_COUNT], p[P_REACH], x, y, cx, cy, least_bits,
                                     marks);
            if (best != NOTHING) resolve(&near, 1, t->outlines, best, x, y, p[P_STOP], t->edition);
            if (at[I_SPANS] >= 0 && gy < n) {
                global const int *span = t->span_index + at[I_SPANS] + gy - t->row0 * BIN;
                in = inside_row(t->spans, span[0], span[1], x);
            }
            reached = reached || at[I_SPANS] >= 0;
        } else {
            reached = straight(&near, t, p, at, x, y);
        }
        LOWER(near, t, 0);
        if (reached && channels) channel_section(&sum, &near, in, p, t);
        if (reached && !channels) cross_section(&sum, &near, in, p, t);
    }
    return sum;
}

// Over a base: see raster.cl.
#ifdef OVER_BASE
#define OVER_ARGUMENTS , global const float *base
#define OVER_SHARE , global float *share, global float *target
#define SET_OVER(t, o, there) (t).over = (there) ? base[o] : 0.0f
#else
#define OVER_ARGUMENTS
#define OVER_SHARE
#define SET_OVER(t, o, there)
#endif

// Work-groups (most bins of a row, rows of bins) of BIN x BIN; of row by0 + j the bins windows[2 j] .. windows[2 j + 1] - 1
// are done. Arguments as in raster.cl.
kernel __attribute__((reqd_work_group_size(BIN, BIN, 1)))
void rasterise(TABLE_ARGUMENTS, int by0, global const int *windows, int n, int pitch, int stride,
               global float *gradient_d, global float *gradient_f, global float *height_d, global float *height_f,
               float screening, int pinned OVER_ARGUMENTS OVER_SHARE) {
    local int least_bits;
    local uint marks[BIN_ITEMS / 32];
    int j = get_group_id(1), bx = windows[2 * j] + get_group_id(0), by = by0 + j;
    if (bx >= windows[2 * j + 1]) return;
    tables_t t = TABLES;
    int gx = bx * BIN + get_local_id(0), gy = by * BIN + get_local_id(1);
    size_t o = (size_t)(gy - row0 * BIN) * pitch + gx - column0 * BIN;
    SET_OVER(t, o, gx < n && gy < n);
    sums_t sum = gather(&t, bx, by, gx, gy, n, &least_bits, marks, 0);
    if (gx >= n || gy >= n) return;
    constraint_t c = conclude(&sum, gx, gy, n, screening, pinned, &t);
    height_d[o] = c.height_d;
    height_f[o] = c.height_f;
    gradient_d[o] = c.gradient_d;
    gradient_f[o] = c.gradient_fx;
    gradient_f[o + stride] = c.gradient_fy;
#ifdef OVER_BASE
    share[o] = c.share;
    target[o] = c.target;
#endif
}

// The same for one of the other channels, as in raster.cl.
kernel __attribute__((reqd_work_group_size(BIN, BIN, 1)))
void rasterise_channel(TABLE_ARGUMENTS, int by0, global const int *windows, int n, int pitch, int stride,
                       global float *d, global float *f, float screening, int covered OVER_ARGUMENTS) {
    local int least_bits;
    local uint marks[BIN_ITEMS / 32];
    int j = get_group_id(1), bx = windows[2 * j] + get_group_id(0), by = by0 + j;
    if (bx >= windows[2 * j + 1]) return;
    tables_t t = TABLES;
    int gx = bx * BIN + get_local_id(0), gy = by * BIN + get_local_id(1);
    size_t o = (size_t)(gy - row0 * BIN) * pitch + gx - column0 * BIN;
    SET_OVER(t, o, gx < n && gy < n);
    sums_t sum = gather(&t, bx, by, gx, gy, n, &least_bits, marks, 1);
    if (gx >= n || gy >= n) return;
    float stiffness, pull, cover;
    conclude_channel(&stiffness, &pull, &cover, &sum, screening);
    d[o] = stiffness;
    f[o] = pull;
    if (covered) f[o + stride] = cover;
}
