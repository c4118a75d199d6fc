// From rasterised constraints to the hierarchy of levels, and what else does one sample at a time on a GPU (DESIGN 5.3).
// Twins: reference.coarsen, reference.divergence, reference.restriction.

// R f at coarse sample (Y, X), mirrored.
inline float restriction_at(cfield_t f, int Y, int X, int n, int pitch) {
    int west = mirrored(2 * X - 1, n), east = mirrored(2 * X + 1, n);
    cfield_t b = f + (size_t)(2 * Y) * pitch, a = f + (size_t)mirrored(2 * Y - 1, n) * pitch,
             c = f + (size_t)mirrored(2 * Y + 1, n) * pitch;
    float sides = (a[2 * X] + c[2 * X]) + (b[west] + b[east]), corners = (a[west] + c[east]) + (a[east] + c[west]);
    return restricted(b[2 * X], sides, corners);
}

// coarse = R fine. Global size (columns, rows, channels) of the coarse level, rounded up.
kernel void restriction(cfield_t fine, field_t coarse, int n, int pitch, int stride, int pitch2, int stride2) {
    int X = get_global_id(0), Y = get_global_id(1), c = get_global_id(2), nc = n / 2 + 1;
    if (X < nc && Y < nc)
        coarse[(size_t)c * stride2 + (size_t)Y * pitch2 + X] = restriction_at(fine + (size_t)c * stride, Y, X, n, pitch);
}

// Springs of one coarse sample: d' = S / (1 + SATURATION S), f' = R f / (1 + SATURATION S), S = R d. Fixed samples count
// as springs of CREST_STIFFNESS.
inline void coarsen_at(cfield_t d, cfield_t f, field_t d2, field_t f2, int Y, int X, int channels, level_t g) {
    float sd = 0.0f, sf[2] = {0.0f, 0.0f};
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            size_t at = (size_t)mirrored(2 * Y + j, g.n) * g.pitch + mirrored(2 * X + i, g.n);
            float w = (j ? 0.5f : 1.0f) * (i ? 0.5f : 1.0f), dv = d[at];
            float share = dv < 0.0f ? w * CREST_STIFFNESS : w;
            sd = fma(w, dv < 0.0f ? CREST_STIFFNESS : dv, sd);
            for (int c = 0; c < channels; c++) sf[c] = fma(share, f[at + (size_t)c * g.stride], sf[c]);
        }
    size_t to = (size_t)Y * g.pitch2 + X;
    float k = 1.0f / fma(SATURATION, sd, 1.0f);
    d2[to] = sd * k;
    for (int c = 0; c < channels; c++) f2[to + (size_t)c * g.stride2] = sf[c] * k;
}

// Coarse rows [from, to). Global size (columns, to - from), rounded up.
kernel void coarsen(cfield_t d, cfield_t f, field_t d2, field_t f2, int n, int pitch, int stride, int pitch2, int stride2,
                    int channels, int from, int to) {
    int X = get_global_id(0), Y = from + get_global_id(1);
    level_t g = {n, pitch, stride, pitch2, stride2, 0.0f};
    if (X <= n / 2 && Y < to) coarsen_at(d, f, d2, f2, Y, X, channels, g);
}

// rhs = f - spacing * div g, at fixed samples f. g: two channels `stride` apart. Global size (columns, rows), rounded up.
kernel void divergence(cfield_t f, cfield_t d, cfield_t g, field_t rhs, int n, int pitch, int stride, float spacing) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= n || y >= n) return;
    size_t at = (size_t)y * pitch + x;
    cfield_t h = g + stride;
    // at a border the row of the operator is doubled
    float across = x == 0 ? -(g[at] + g[at + 1]) : x == n - 1 ? g[at] + g[at - 1] : -0.5f * (g[at + 1] - g[at - 1]);
    float along = y == 0       ? -(h[at] + h[at + pitch])
                  : y == n - 1 ? h[at] + h[at - pitch]
                               : -0.5f * (h[at + pitch] - h[at - pitch]);
    rhs[at] = d[at] < 0.0f ? f[at] : fma(spacing, across + along, f[at]);
}

// out[group] = largest |a - b| of the samples of a group, all channels. Work-groups of CHANGE_ITEMS, which each stride
// through the level.
kernel __attribute__((reqd_work_group_size(CHANGE_ITEMS, 1, 1)))
void change(cfield_t a, cfield_t b, field_t out, int n, int pitch, int stride, int channels) {
    local float most[CHANGE_ITEMS];
    int i = get_local_id(0);
    float m = 0.0f;
    for (int row = get_group_id(0); row < n * channels; row += get_num_groups(0)) {
        size_t at = (size_t)(row / n) * stride + (size_t)(row % n) * pitch;
        for (int x = i; x < n; x += CHANGE_ITEMS) m = fmax(m, fabs(a[at + x] - b[at + x]));
    }
    most[i] = m;
    for (int apart = CHANGE_ITEMS / 2; apart > 0; apart /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (i < apart) most[i] = fmax(most[i], most[i + apart]);
    }
    if (i == 0) out[get_group_id(0)] = most[0];
}
