// From rasterised constraints to the hierarchy of levels, and what else does one sample at a time on a GPU (DESIGN 5.3).
// Twins: reference.coarsen, reference.divergence, reference.restriction, reference.held.

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

// Two or three restrictions behind each other: out1 = R fine, out2 = R out1, out3 = R out2 (may be null), the same bits as
// one by one. A work-group does CHAIN x CHAIN samples of out3 and all that lies under them; what it needs of its
// neighbours it computes again. Global size (columns, rows of groups, channels).
#define CHAIN1 (4 * CHAIN + 3)
#define CHAIN2 (2 * CHAIN + 1)
inline float restricted_local(local const float *v, int width) {
    float sides = (v[-width] + v[width]) + (v[-1] + v[1]);
    return restricted(v[0], sides, (v[-width - 1] + v[width + 1]) + (v[-width + 1] + v[width - 1]));
}

kernel __attribute__((reqd_work_group_size(CHAIN_ITEMS, 1, 1)))
void restriction_chain(cfield_t fine, field_t out1, field_t out2, field_t out3, int n, int pitch, int stride, int pitch1,
                       int stride1, int pitch2, int stride2, int pitch3, int stride3) {
    local float a[CHAIN1 * CHAIN1], b[CHAIN2 * CHAIN2];
    const int lid = get_local_id(0), x0 = get_group_id(0) * CHAIN, y0 = get_group_id(1) * CHAIN;
    const int n1 = n / 2 + 1, n2 = n1 / 2 + 1, n3 = n2 / 2 + 1;
    const size_t c = get_group_id(2);
    for (int i = lid; i < CHAIN1 * CHAIN1; i += CHAIN_ITEMS) {
        int y = i / CHAIN1 - 3, x = i % CHAIN1 - 3, Y = 4 * y0 + y, X = 4 * x0 + x;
        a[i] = restriction_at(fine + c * stride, mirrored(Y, n1), mirrored(X, n1), n, pitch);
        if (y >= 0 && x >= 0 && y < 4 * CHAIN && x < 4 * CHAIN && Y < n1 && X < n1)
            out1[c * stride1 + (size_t)Y * pitch1 + X] = a[i];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int i = lid; i < CHAIN2 * CHAIN2; i += CHAIN_ITEMS) {
        int y = i / CHAIN2 - 1, x = i % CHAIN2 - 1, Y = 2 * y0 + y, X = 2 * x0 + x;
        b[i] = restricted_local(a + (2 * y + 3) * CHAIN1 + 2 * x + 3, CHAIN1);
        if (y >= 0 && x >= 0 && Y < n2 && X < n2) out2[c * stride2 + (size_t)Y * pitch2 + X] = b[i];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!out3) return;
    for (int i = lid; i < CHAIN * CHAIN; i += CHAIN_ITEMS) {
        int y = i / CHAIN, x = i % CHAIN, Y = y0 + y, X = x0 + x;
        if (Y < n3 && X < n3)
            out3[c * stride3 + (size_t)Y * pitch3 + X] = restricted_local(b + (2 * y + 1) * CHAIN2 + 2 * x + 1, CHAIN2);
    }
}

// Whether a sample is at least so stiff.
inline int at_least(float d, float least) { return d < 0.0f || d >= least; }

// Whether a coarse sample is on a crest along one of the lines through it (reference.on_lines), from the stiffness there
// and west, east, south and north of it.
inline int on_line(float here, float w, float e, float s, float n) {
    const float line = 0.5f * LINE_STIFFNESS, firm = FIRM_STIFFNESS;
    int strong = at_least(here, line) && ((at_least(w, line) && at_least(e, line)) || (at_least(s, line) && at_least(n, line)));
    int across = at_least(w, firm) + at_least(e, firm), along = at_least(s, firm) + at_least(n, firm);
    return strong || (at_least(here, firm) && ((across == 2 && along == 0) || (along == 2 && across == 0)));
}

// Springs of one coarse sample: d' = S / (1 + SATURATION S), f' = R f / (1 + SATURATION S), S = R d. Fixed samples count
// as springs of CREST_STIFFNESS; a pinned border stays as good as fixed, a crest along a line nearly so.
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
    size_t to = (size_t)Y * g.pitch2 + X, middle = (size_t)(2 * Y) * g.pitch, at = middle + 2 * X;
    float k = 1.0f / fma(SATURATION, sd, 1.0f), here = d[at];
    int pinned = here <= PINNED || here >= 0.5f * PINNED_STIFFNESS;
    int line = on_line(here, d[middle + mirrored(2 * X - 1, g.n)], d[middle + mirrored(2 * X + 1, g.n)],
                       d[(size_t)mirrored(2 * Y - 1, g.n) * g.pitch + 2 * X],
                       d[(size_t)mirrored(2 * Y + 1, g.n) * g.pitch + 2 * X]);
    float stiff = here < 0.0f ? LINE_STIFFNESS : LINE_STIFFNESS / fmax(here, 1.0f);
    d2[to] = pinned ? PINNED_STIFFNESS : line ? LINE_STIFFNESS : sd * k;
    for (int c = 0; c < channels; c++)
        f2[to + (size_t)c * g.stride2] = pinned ? 0.0f : line ? stiff * f[at + (size_t)c * g.stride] : sf[c] * k;
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

// u = f where fixed. Global size (columns, rows), rounded up.
kernel void hold_fixed(cfield_t f, cfield_t d, field_t u, int n, int pitch) {
    int x = get_global_id(0), y = get_global_id(1);
    size_t at = (size_t)y * pitch + x;
    if (x < n && y < n && d[at] < 0.0f) u[at] = f[at];
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
