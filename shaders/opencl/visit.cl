// The fused level visit (DESIGN 5.3): prolong the correction, sweep, restrict the residual, in one pass over a strip of
// rows. Twins: reference.visit, plain.cl. One work-item runs a wave down its strip: when row t has entered, sweep k can
// do row t - k, so all sweeps of a row happen while it is in cache; and the row that sweep k needs to the north is what
// sweep k - 1 has just made, in a register. Strips repeat a few rows of their neighbours, blocks of columns a few
// columns, and all agree to the bit: every sample is made by the same operations, none of which the compiler may fuse.
// The sizes are those of backend/esker/solve/opencl/wave.py.
#if CHEBYSHEV_SWEEPS != 4
#error "a wave has four sweeps"
#endif
#if (TILE_CELLS >> (BOTTOM_LEVELS - 1)) != 8
#error "the smallest level that is swept has nine samples a side"
#endif
#define AHEAD 4  // rows that are fetched before they are needed

typedef struct {
    int n, pitch, pitch2;
    float screening;
} level_t;

// Scratch of one work-item, lanes of LANE floats, few enough for a core's first cache. A slot holds what entered with a
// row: q = 1 / (4 + t), or 0 where fixed; t = d + screening; the right-hand side. Behind the slots: three rows of the
// start; what sweeps 1 to 4 made last, of even and of odd rows; three rows of the residual.
#define SLOT(y) (ring + (((y) + SLOTS) % SLOTS) * 3 * LANE)
#define START(y) (ring + (3 * SLOTS + ((y) + SLOTS) % 3) * LANE)
#define SWEPT(y) (ring + (3 * SLOTS + 3 + ((y) & 1) * 4) * LANE)
#define RESIDUAL(y) (ring + (3 * SLOTS + 11 + ((y) + SLOTS) % 3) * LANE)
#define T_LANE LANE
#define RHS_LANE (2 * LANE)

// Where a row enters from; guess and the two coarse rows of the correction may be null.
typedef struct {
    crow_t d, guess, rhs, c0, c1;
    int ahead, ahead2;  // floats to the rows that the caches should fetch meanwhile
    float screening;
} source_t;

// 16 samples of P of the coarse rows c0 and c1 added to base. The mean of two or four is taken last: exact either way.
FORCE_INLINE float16 add_prolonged(float16 base, crow_t c0, crow_t c1) {
    const float16 share = {0.5f, 0.25f, 0.5f, 0.25f, 0.5f, 0.25f, 0.5f, 0.25f,
                           0.5f, 0.25f, 0.5f, 0.25f, 0.5f, 0.25f, 0.5f, 0.25f};
    float8 two = load8(c0) + load8(c1), four = two + (load8(c0 + 1) + load8(c1 + 1));
    return fma(__builtin_shufflevector(two, four, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15), share, base);
}

// A row enters at x: what the operator needs; start = guess + P correction, the correction only where not fixed,
// without guess zero, or fixed; the right-hand side. Returns the start.
FORCE_INLINE float16 enter16(row_t slot, row_t start, const source_t *in, long x) {
    float16 d = load16(in->d + x), t = d + in->screening, f = load16(in->rhs + x), u = 0.0f, held = f;
    int16 fixed = d < 0.0f;
    prefetch_read(in->d + in->ahead + x);
    prefetch_read(in->rhs + in->ahead + x);
    if (in->guess) {
        held = u = load16(in->guess + x);
        prefetch_read(in->guess + in->ahead + x);
    }
    if (in->c0) {
        u = add_prolonged(u, in->c0 + x / 2, in->c1 + x / 2);
        prefetch_read(in->c1 + in->ahead2 + x / 2);
    }
    u = select(u, held, fixed);
    store16(select(1.0f / (4.0f + t), (float16)(0.0f), fixed), slot + x);
    store16(t, slot + T_LANE + x);
    store16(f, slot + RHS_LANE + x);
    store16(u, start + x);
    return u;
}

// What a stage carries from one vector of a row to the next: the samples, and their differences to the east.
typedef struct {
    float16 c, east;
} carry_t;

// The 16 samples that begin with the second of a; with the last of a.
FORCE_INLINE float16 one_on(float16 a, float16 b) {
    return __builtin_shufflevector(a, b, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16);
}
FORCE_INLINE float16 one_back(float16 a, float16 b) {
    return __builtin_shufflevector(a, b, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
}

// The difference across the western border is mirrored; at the western end of a block's halo it does not matter. Nine
// samples have their eastern border within the vector.
FORCE_INLINE carry_t carry(crow_t here, int n) {
    float16 c = load16(here);
    if (n < VW) c.s9 = c.s7;
    carry_t k = {c, (float16)(c.s0 - c.s1)};
    return k;
}

// Stage k of row y at x: rhs - A u of what the stage before made, whose rows y - 1 and y are `before` and `here`, and
// row y + 1 is `north`; kept in `before` when it is not there yet. *c: u itself. `edge`: y may be 0 or n - 1. `end`: x
// is the eastern border, which whole vectors always leave over.
FORCE_INLINE float16 stage(float16 *c, carry_t *k, float16 north, row_t before, crow_t here, crow_t slot, long x, int y,
                           int n, const int keep, const int edge, const int end) {
    float16 south = load16(before + x), beyond = south, next = k->c, west, east;
    *c = k->c;
    if (keep) store16(north, before + x);
    if (edge && y == 0) south = north;
    if (edge && y == n - 1) north = beyond;
    if (end) {
        west = one_back(k->east, k->east);
        east = -west;
    } else {
        next = load16(here + x + VW);
        east = one_on(*c, next) - *c;
        west = one_back(k->east, east);
    }
    k->c = next;
    k->east = east;
    float16 rest = (east - west) + ((south - *c) + load16(slot + RHS_LANE + x));
    return fma(-load16(slot + T_LANE + x), *c, rest) + (north - *c);
}

// Rows of one time step, and what its stages carry along them.
typedef struct {
    row_t s0, s1, s2, s3, s4, s5, start, start1, start2, even, odd, residual, out;
    crow_t old;   // what `out` is compared with, or null
    float16 most;  // the largest change yet
    long out_a, out_b;
    carry_t k1, k2, k3, k4, k5;
} step_t;

FORCE_INLINE void wave16(step_t *s, int n, const source_t *in, int t, int entering, long x, float4 w, const int edge,
                         const int end) {
    float16 c, r, u = 0.0f;
    if (!edge || entering) u = enter16(s->s0, s->start, in, x);
    r = stage(&c, &s->k1, u, s->start2, s->start1, s->s1, x, t - 1, n, 0, edge, end);
    u = fma(w.x * load16(s->s1 + x), r, c);
    r = stage(&c, &s->k2, u, s->odd, s->even, s->s2, x, t - 2, n, 1, edge, end);
    u = fma(w.y * load16(s->s2 + x), r, c);
    r = stage(&c, &s->k3, u, s->even + LANE, s->odd + LANE, s->s3, x, t - 3, n, 1, edge, end);
    u = fma(w.z * load16(s->s3 + x), r, c);
    r = stage(&c, &s->k4, u, s->odd + 2 * LANE, s->even + 2 * LANE, s->s4, x, t - 4, n, 1, edge, end);
    u = fma(w.w * load16(s->s4 + x), r, c);
    if (x >= s->out_a && x < s->out_b) {
        store16(u, s->out + x);
        prefetch_write(s->out + in->ahead + x);
        if (s->old) {
            float16 change = fabs(u - load16(s->old + x));
            s->most = fmax(s->most, end ? (float16)(change.s0) : change);
        }
    }
    r = stage(&c, &s->k5, u, s->even + 3 * LANE, s->odd + 3 * LANE, s->s5, x, t - 5, n, 1, edge, end);
    // fixed: its inverse is 0 (where screening is strong, t is positive there, too)
    store16(select(r, (float16)(0.0f), load16(s->s5 + x) == 0.0f), s->residual + x);
}

// One time step of m columns: row t enters, sweep k does row t - k, the residual is that of row t - 5. The last sweep
// also goes to `out`, columns [out_a, out_b); returned is its largest difference from `old`, if that is given, or
// `most`, if that is larger. `edge`: rows 0 or n - 1 may be among these, or no row be left to enter.
FORCE_INLINE float16 wave_row(row_t ring, int n, source_t in, row_t out, crow_t old, float16 most, int t, int entering,
                              long m, int right, long out_a, long out_b, float4 w, const int edge) {
    row_t even = SWEPT(t), odd = SWEPT(t - 1);
    step_t s = {SLOT(t), SLOT(t - 1), SLOT(t - 2), SLOT(t - 3), SLOT(t - 4), SLOT(t - 5), START(t), START(t - 1),
                START(t - 2), even, odd, RESIDUAL(t - 5), out, old, most, out_a, out_b, carry(START(t - 1), n),
                carry(even, n), carry(odd + LANE, n), carry(even + 2 * LANE, n), carry(odd + 3 * LANE, n)};
    for (long x = 0; x < m - right; x += VW) wave16(&s, n, &in, t, entering, x, w, edge, 0);
    if (right) wave16(&s, n, &in, t, entering, m - 1, w, edge, 1);
    return s.most;
}

// `count` coarse samples from three rows of the residual's columns from `from` on, and one more at the eastern border.
FORCE_INLINE void restrict_lanes(row_t out, crow_t a, crow_t b, crow_t c, long from, long count, int left, int right) {
    float16 before = 0.0f;
    if (!left) before = load16(b + from - VW) + 0.5f * (load16(a + from - VW) + load16(c + from - VW));
    for (long x = 0; x < count; x += VW) {
        long at = from + 2 * x;
        float16 u = load16(b + at) + 0.5f * (load16(a + at) + load16(c + at));
        float16 v = load16(b + at + VW) + 0.5f * (load16(a + at + VW) + load16(c + at + VW));
        float16 even = __builtin_shufflevector(u, v, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        float16 odd = __builtin_shufflevector(u, v, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
        if (left && x == 0) before = (float16)(odd.s0);
        store16(even + 0.5f * (odd + one_back(before, odd)), out + x);
        before = odd;
    }
    if (right) {
        long at = from + 2 * count;
        out[count] = (b[at] + 0.5f * (a[at] + c[at])) + (b[at - 1] + 0.5f * (a[at - 1] + c[at - 1]));
    }
}

// Rows [y0, y1), columns [x0, x1) of out = sweeps of (guess + P correction); coarse = R (rhs - A out) if given. guess,
// correction and coarse may be null. Returns the largest change from the guess, if `compare` says so, and `most`.
FORCE_INLINE float16 visit_block(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse,
                                 level_t g, row_t ring, int y0, int y1, int x0, int x1, constant float *weights,
                                 int compare, float16 most) {
    int n = g.n, halo = CHEBYSHEV_SWEEPS + (coarse ? 2 : 0), lo = max(0, y0 - halo), hi = min(n, y1 + halo);
    int xa = max(0, x0 - HALO), xb = min(n, x1 + HALO), m = xb - xa, left = xa == 0, right = xb == n && n > VW;
    int last = y1 - 1 + CHEBYSHEV_SWEEPS + (coarse ? 1 : 0), out_a = x0 - xa;
    float4 w = {weights[0], weights[1], weights[2], weights[3]};
    for (int t = lo; t <= last; t++) {
        int out_y = t - CHEBYSHEV_SWEEPS, inside = out_y >= y0 && out_y < y1, out_b = inside ? x1 - xa : 0;
        source_t in = {crow(d, t, g.pitch) + xa,
                       guess ? crow(guess, t, g.pitch) + xa : 0,
                       crow(rhs, t, g.pitch) + xa,
                       correction ? crow(correction, t / 2, g.pitch2) + xa / 2 : 0,
                       correction ? crow(correction, (t + 1) / 2, g.pitch2) + xa / 2 : 0,
                       AHEAD * g.pitch, AHEAD / 2 * g.pitch2, g.screening};
        row_t o = inside ? row(out, out_y, g.pitch) + xa : 0;
        crow_t old = inside && compare ? crow(guess, out_y, g.pitch) + xa : 0;
        if (t < CHEBYSHEV_SWEEPS + 2 || t >= n)
            most = wave_row(ring, n, in, o, old, most, t, t < hi, m, right, out_a, out_b, w, 1);
        else
            most = wave_row(ring, n, in, o, old, most, t, 1, m, right, out_a, out_b, w, 0);
        int y = out_y - 1, centre = (y & 1) ? y - 1 : (y == n - 1 ? y : -1);
        if (coarse && centre >= y0 && centre < y1)
            restrict_lanes(row(coarse, centre / 2, g.pitch2) + x0 / 2, RESIDUAL(mirror(centre - 1, n)),
                           RESIDUAL(centre), RESIDUAL(mirror(centre + 1, n)), out_a, (x1 - x0) / 2, left, right);
    }
    return most;
}

inline float largest(float16 v) {
    float8 a = fmax(v.lo, v.hi);
    float4 b = fmax(a.lo, a.hi);
    float2 c = fmax(b.lo, b.hi);
    return fmax(c.x, c.y);
}

// Global size (strips, channels); d is shared by the channels. `rows` is even. Blocks of columns one after the other.
// changes: if given, the largest change from the guess of every work-item.
kernel void visit(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse, int n, int pitch,
                  int pitch2, int stride, int stride2, float screening, row_t scratch, int scratch_stride, int rows,
                  constant float *weights, row_t changes) {
    int s = get_global_id(0), c = get_global_id(1), y0 = s * rows, y1 = min(n, y0 + rows);
    size_t fine = (size_t)c * stride, under = (size_t)c * stride2;
    row_t ring = scratch + (size_t)(c * get_global_size(0) + s) * scratch_stride;
    level_t g = {n, pitch, pitch2, screening};
    float16 most = 0.0f;
    for (int x0 = 0; x0 < n - 1; x0 += BLOCK)
        most = visit_block(guess ? guess + fine : 0, correction ? correction + under : 0, rhs + fine, d, out + fine,
                           coarse ? coarse + under : 0, g, ring, y0, y1, x0, x0 + BLOCK < n - 1 ? x0 + BLOCK : n,
                           weights, changes != 0, most);
    if (changes) changes[c * get_global_size(0) + s] = largest(most);
}

// Coarse rows [from, to) of R fine. tmp: scratch for one fine row.
FORCE_INLINE void restrict_rows(crow_t fine, row_t coarse, int n, int pitch, int pitch2, row_t tmp, int from, int to) {
    for (int J = from; J < to; J++)
        restrict_row(row(coarse, J, pitch2), crow(fine, mirror(2 * J - 1, n), pitch), crow(fine, 2 * J, pitch),
                     crow(fine, mirror(2 * J + 1, n), pitch), tmp, n);
}

// coarse = R fine. Global size (strips, channels).
kernel void restriction(crow_t fine, row_t coarse, int n, int pitch, int pitch2, int stride, int stride2, row_t scratch,
                        int scratch_stride, int rows) {
    int s = get_global_id(0), c = get_global_id(1), nc = n / 2 + 1;
    row_t tmp = scratch + (size_t)(c * get_global_size(0) + s) * scratch_stride + PAD;
    restrict_rows(fine + (size_t)c * stride, coarse + (size_t)c * stride2, n, pitch, pitch2, tmp, s * rows,
                  min(nc, (s + 1) * rows));
}

// coarse = R (rhs - A u) of a level that fits a lane.
FORCE_INLINE void restrict_residual(row_t u, crow_t rhs, crow_t d, row_t coarse, level_t g, row_t ring) {
#define RESIDUAL_OF(y) (ring + (mirror(y, n) & 3) * LANE + PAD)
    int n = g.n;
    for (int y = 0; y < n; y++) ghosts(row(u, y, g.pitch), n);
    for (int y = 0; y < n; y++) {
        row_t here = row(u, y, g.pitch), r = RESIDUAL_OF(y);
        crow_t f = crow(rhs, y, g.pitch), dr = crow(d, y, g.pitch), south = crow(u, mirror(y - 1, n), g.pitch);
        crow_t north = crow(u, mirror(y + 1, n), g.pitch);
        for (int x = 0; x < n; x += VW) {
            float16 c = load16(here + x), dv = load16(dr + x);
            float16 across = (load16(here + x + 1) - c) - (c - load16(here + x - 1));
            float16 rest = across + ((load16(south + x) - c) + load16(f + x));
            float16 v = fma(-(dv + g.screening), c, rest) + (load16(north + x) - c);
            store16(select(v, (float16)(0.0f), dv < 0.0f), r + x);
        }
        int centre = (y & 1) ? y - 1 : (y == n - 1 ? y : -1);
        if (centre >= 0)
            restrict_row(row(coarse, centre / 2, g.pitch2), RESIDUAL_OF(centre - 1), RESIDUAL_OF(centre),
                         RESIDUAL_OF(centre + 1), ring + 4 * LANE + PAD, n);
    }
}

// Area of the control volume of a sample of the coarsest level, in cells.
FORCE_INLINE float control_volume(int y, int x, int n) {
    return (y == 0 || y == n - 1 ? 0.5f : 1.0f) * (x == 0 || x == n - 1 ? 0.5f : 1.0f);
}

// Over-relaxations from the constant that balances b; where nothing holds the ground its mean is zero
// (reference.relaxation_matrix).
FORCE_INLINE void relax_coarsest(row_t u, crow_t b, crow_t d, level_t g) {
    float stiffness = 0.0f, load = 0.0f, start = 0.0f, total = 0.0f, cells = (float)((g.n - 1) * (g.n - 1));
    for (int y = 0; y < g.n; y++)
        for (int x = 0; x < g.n; x++) {
            float share = control_volume(y, x, g.n);
            stiffness += share * (crow(d, y, g.pitch)[x] + g.screening);
            load += share * crow(b, y, g.pitch)[x];
        }
    if (stiffness > LEAST_HOLD) start = load / stiffness;
    for (int y = 0; y < g.n; y++)
        for (int x = -PAD; x < g.pitch - PAD; x++) row(u, y, g.pitch)[x] = start;
    for (int s = 0; s < COARSEST_SWEEPS; s++)
        for (int y = 0; y < g.n; y++)
            for (int x = 0; x < g.n; x++) {
                row_t r = row(u, y, g.pitch);
                float around = row(u, mirror(y - 1, g.n), g.pitch)[x] + row(u, mirror(y + 1, g.n), g.pitch)[x] +
                               r[mirror(x - 1, g.n)] + r[mirror(x + 1, g.n)];
                float value = (crow(b, y, g.pitch)[x] + around) / (4.0f + crow(d, y, g.pitch)[x] + g.screening);
                r[x] += COARSEST_RELAXATION * (value - r[x]);
            }
    if (stiffness > LEAST_HOLD) return;
    for (int y = 0; y < g.n; y++)
        for (int x = 0; x < g.n; x++) total += control_volume(y, x, g.n) * row(u, y, g.pitch)[x];
    for (int y = 0; y < g.n; y++)
        for (int x = 0; x < g.n; x++) row(u, y, g.pitch)[x] -= total / cells;
}

// V-cycles from zero on level 0 and the levels behind it in the same buffers, one work-item per channel.
// tab[4 k]: offset, n, pitch of level -k. work: the right-hand sides of the levels below; screening: of level 0.
kernel void bottom(crow_t rhs, crow_t d, row_t out, row_t work, constant int *tab, int levels, int stride,
                   float screening, row_t scratch, int scratch_stride, constant float *weights, int cycles) {
    int c = get_global_id(0);
    row_t ring = scratch + (size_t)c * scratch_stride;
    rhs += (size_t)c * stride;
    out += (size_t)c * stride;
    work += (size_t)c * stride;
    level_t g[BOTTOM_LEVELS + 1];
    for (int k = 0; k <= levels; k++) {
        level_t of_k = {tab[4 * k + 1], tab[4 * k + 2], k < levels ? tab[4 * k + 6] : 0, screening};
        g[k] = of_k;
        screening *= 4.0f;
    }
    for (int y = 0; y < g[0].n; y++)
        for (int x = 0; x < g[0].n; x += VW) {
            size_t at = (size_t)y * g[0].pitch + PAD + x;
            store16(select((float16)(0.0f), load16(rhs + at), load16(d + at) < 0.0f), out + at);
        }
    for (int i = 0; i < cycles; i++) {
        for (int k = 0; k < levels; k++) {
            int o = tab[4 * k], o2 = tab[4 * k + 4];
            if (k == 0)
                restrict_residual(out, rhs, d, work + o2, g[0], ring);
            else
                restrict_rows(work + o, work + o2, g[k].n, g[k].pitch, g[k].pitch2, ring + PAD, 0, g[k + 1].n);
        }
        int o = tab[4 * levels];
        relax_coarsest(out + o, work + o, d + o, g[levels]);
        for (int k = levels - 1; k >= 0; k--) {
            int at = tab[4 * k], under = tab[4 * k + 4];
            visit_block(k ? 0 : out, out + under, k ? work + at : rhs, d + at, out + at, 0, g[k], ring, 0, g[k].n, 0,
                        g[k].n, weights, 0, 0.0f);
        }
    }
}

// Largest |a - b| of a strip of rows, all channels one after the other. Global size (strips).
kernel void change(crow_t a, crow_t b, row_t out, int n, int pitch, int stride, int channels, int rows) {
    int s = get_global_id(0);
    float most = 0.0f;
    for (int c = 0; c < channels; c++)
        for (int y = s * rows; y < min(n, (s + 1) * rows); y++) {
            crow_t p = crow(a + (size_t)c * stride, y, pitch), q = crow(b + (size_t)c * stride, y, pitch);
            int x = 0;
            float16 m = 0.0f;
            for (; x + VW <= n; x += VW) m = fmax(m, fabs(load16(p + x) - load16(q + x)));
            most = fmax(most, largest(m));
            for (; x < n; x++) most = fmax(most, fabs(p[x] - q[x]));
        }
    out[s] = most;
}
