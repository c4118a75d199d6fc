// The fused level visit (DESIGN 5.3): prolong the correction, sweep, restrict the residual, in one pass over a strip of
// rows. Twins: reference.visit, plain.cl. One work-item runs a wave down its strip: when row t has entered, sweep k can
// do row t - k, so all sweeps of a row happen while it is in cache; and the row that sweep k needs to the north is what
// sweep k - 1 has just made, in a register. Strips repeat a few rows of their neighbours, blocks of columns a few
// columns, and all agree to the bit: every sample is made by the same operations, none of which the compiler may fuse.
#if CHEBYSHEV_SWEEPS != 4
#error "wave_row does four sweeps"
#endif

typedef struct {
    int n, pitch, pitch2, channels, stride, stride2;
    float screening;
} level_t;

// Scratch of one work-item, lanes of LANE floats. A slot holds what entered with one row: q = 1 / (4 + t), or 0 where
// fixed; t = d + screening; and per channel the start and the right-hand side. Behind the slots, per channel: the rows
// that sweeps 1 to 4 made last, of even and of odd rows; four rows of the residual; one for its restriction.
#define RING_LANES (SLOTS * SLOT_LANES + 2 * OWN_LANES)
#define AHEAD 2  // rows that are fetched before they are needed
#define SLOT(y) (ring + ((y) % SLOTS) * (2 + 2 * g.channels) * LANE + PAD)
#define T_LANE LANE
#define START_LANE(channel) ((2 + 2 * (channel)) * LANE)
#define RHS_LANE(channel) ((3 + 2 * (channel)) * LANE)
#define OWN(channel) (ring + (SLOTS * SLOT_LANES + (channel) * OWN_LANES) * LANE + PAD)
#define PARITY(own, y) (own + ((y) & 1) * 4 * LANE)
#define RESIDUAL(own, y) (own + (8 + ((y) & 3)) * LANE)
#define TEMP(own) (own + 12 * LANE)

// Where a row of one channel enters from; guess and the two coarse rows of the correction may be null.
typedef struct {
    crow_t d, guess, rhs, c0, c1;
    int ahead;  // floats from a row to one that the caches should fetch meanwhile
    float screening;
} source_t;

// 16 samples of P (mean of c0, c1).
FORCE_INLINE float16 prolong16(crow_t c0, crow_t c1, long x) {
    float8 c = 0.5f * (load8(c0 + x / 2) + load8(c1 + x / 2));
    float8 b = 0.5f * (load8(c0 + x / 2 + 1) + load8(c1 + x / 2 + 1)), m = 0.5f * (c + b);
    return __builtin_shufflevector(c, m, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
}

// A row enters at x: what the operator needs, by channel 0; start = guess + P correction, the correction only where not
// fixed, without guess zero, or fixed; the right-hand side. Returns the start.
FORCE_INLINE float16 enter16(row_t slot, const source_t *in, long x, const int channel) {
    float16 q;
    prefetch_row(in->rhs + in->ahead + x);
    if (channel == 0) {
        float16 d = load16(in->d + x), t = d + in->screening;
        prefetch_row(in->d + in->ahead + x);
        q = select(1.0f / (4.0f + t), (float16)(0.0f), d < 0.0f);
        store16(q, slot + x);
        store16(t, slot + T_LANE + x);
    } else
        q = load16(slot + x);
    float16 f = load16(in->rhs + x), base = 0.0f, held = f;
    if (in->guess) {
        held = base = load16(in->guess + x);
        prefetch_row(in->guess + in->ahead + x);
    }
    if (in->c0) base += prolong16(in->c0, in->c1, x);
    float16 start = select(base, held, q == 0.0f);
    store16(start, slot + START_LANE(channel) + x);
    store16(f, slot + RHS_LANE(channel) + x);
    return start;
}

// What a stage carries from one vector of a row to the next: the samples, and their differences to the east.
typedef struct {
    float16 c, east;
} carry_t;

FORCE_INLINE carry_t carry(crow_t here) {
    carry_t k = {load16(here), load16(here + 1 - VW) - load16(here - VW)};
    return k;
}

// Stage k of row y at x. `before`, `here`: rows y - 1 and y of the stage before; north: row y + 1 of it, kept in `before`
// when it is not there yet. Returns rhs - A u, and c, the sample itself.
FORCE_INLINE float16 stage(float16 *centre, carry_t *k, float16 north, row_t before, crow_t here, crow_t slot, long x, int y,
                     int n, const int channel, const int keep, const int edge) {
    float16 c = k->c, south = load16(before + x), beyond = south, next = load16(here + x + VW);
    if (keep) store16(north, before + x);
    if (edge && y == 0) south = north;
    if (edge && y == n - 1) north = beyond;
    float16 east = __builtin_shufflevector(c, next, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16) - c;
    float16 west = __builtin_shufflevector(k->east, east, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
    k->c = next;
    k->east = east;
    *centre = c;
    float16 rest = fma(-load16(slot + T_LANE + x), c, (east - west) + ((south - c) + load16(slot + RHS_LANE(channel) + x)));
    return rest + (north - c);
}

// One time step of b columns: row t enters, sweep k does row t - k, the residual is that of row t - 5. The last sweep
// also goes to `out`, columns [out_a, out_b). `edge`: some of these rows may be rows 0 or n - 1, or there is none left.
FORCE_INLINE void wave_row(row_t ring, level_t g, source_t in, row_t out, int t, int entering, long b, long out_a, long out_b,
                           constant float *w, const int channel, const int edge) {
    row_t own = OWN(channel), even = PARITY(own, t), odd = PARITY(own, t - 1), residual = RESIDUAL(own, t - 5);
    row_t s0 = SLOT(t + SLOTS), s1 = SLOT(t - 1 + SLOTS), s2 = SLOT(t - 2 + SLOTS), s3 = SLOT(t - 3 + SLOTS), s4 = SLOT(t - 4 + SLOTS), s5 = SLOT(t - 5 + SLOTS);
    const int start = START_LANE(channel);
    float w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3];
    int n = g.n;
    carry_t k1 = carry(s1 + start), k2 = carry(even), k3 = carry(odd + LANE), k4 = carry(even + 2 * LANE), k5 = carry(odd + 3 * LANE);
    for (long x = 0; x < b; x += VW) {
        float16 c, r, u = 0.0f;
        if (!edge || entering) u = enter16(s0, &in, x, channel);
        r = stage(&c, &k1, u, s2 + start, s1 + start, s1, x, t - 1, n, channel, 0, edge);
        u = fma(w0 * load16(s1 + x), r, c);
        r = stage(&c, &k2, u, odd, even, s2, x, t - 2, n, channel, 1, edge);
        u = fma(w1 * load16(s2 + x), r, c);
        r = stage(&c, &k3, u, even + LANE, odd + LANE, s3, x, t - 3, n, channel, 1, edge);
        u = fma(w2 * load16(s3 + x), r, c);
        r = stage(&c, &k4, u, odd + 2 * LANE, even + 2 * LANE, s4, x, t - 4, n, channel, 1, edge);
        u = fma(w3 * load16(s4 + x), r, c);
        if (x >= out_a && x < out_b) store16(u, out + x);
        r = stage(&c, &k5, u, even + 3 * LANE, odd + 3 * LANE, s5, x, t - 5, n, channel, 1, edge);
        store16(select(r, (float16)(0.0f), load16(s5 + x) == 0.0f), residual + x);
    }
}

// Mirror images beside the block's rows, where the domain ends: of the rows that time step t has made.
FORCE_INLINE void mirror_columns(row_t ring, level_t g, int t, int m, int left, int right, int channel) {
    row_t own = OWN(channel), rows[5] = {SLOT(t + SLOTS) + START_LANE(channel), PARITY(own, t - 1), PARITY(own, t) + LANE,
                                         PARITY(own, t - 1) + 2 * LANE, PARITY(own, t) + 3 * LANE};
    for (int k = 0; k < 5; k++) {
        if (left) rows[k][-1] = rows[k][1];
        if (right) rows[k][m] = rows[k][m - 2];
    }
}

// Coarse columns [0, count) of out from a row of the residual and its neighbours.
FORCE_INLINE void restrict_lane(row_t out, crow_t a, crow_t b, crow_t c, row_t tmp, int from, int m, int left, int right, int count) {
    for (int x = 0; x < m; x += VW)
        store16(load16(b + x) + 0.5f * (load16(a + x) + load16(c + x)), tmp + x);
    if (left) tmp[-1] = tmp[1];
    if (right) tmp[m] = tmp[m - 2];
    for (int x = 0; x < count; x += VW) {
        row_t r = tmp + from + 2 * x;
        float16 u = load16(r), v = load16(r + VW), l = load16(r - 1), o = load16(r + VW - 1);
        store16((float16)(u.even + 0.5f * (u.odd + l.even), v.even + 0.5f * (v.odd + o.even)), out + x);
    }
}

// Rows [y0, y1), columns [x0, x1) of out = sweeps of (guess + P correction); coarse = R (rhs - A out) if given. guess,
// correction and coarse may be null. All channels: what belongs to the operator is made once.
FORCE_INLINE void visit_block(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse, level_t g,
                        row_t ring, int y0, int y1, int x0, int x1, constant float *w) {
    int n = g.n, halo = CHEBYSHEV_SWEEPS + (coarse ? 2 : 0), lo = max(0, y0 - halo), hi = min(n, y1 + halo);
    int xa = max(0, x0 - HALO), xb = min(n, x1 + HALO), m = xb - xa, left = xa == 0, right = xb == n;
    int out_a = x0 - xa, out_b = x1 - xa, last = y1 - 1 + CHEBYSHEV_SWEEPS + (coarse ? 1 : 0);
    for (int t = lo; t <= last; t++) {
        for (int c = 0; c < g.channels; c++) {
            size_t fine = (size_t)c * g.stride + xa, under = (size_t)c * g.stride2 + xa / 2;
            int y = t - CHEBYSHEV_SWEEPS, inside = y >= y0 && y < y1, entering = t < hi, out_end = inside ? out_b : 0;
            int edge = t < CHEBYSHEV_SWEEPS + 2 || t >= n;
            source_t in = {crow(d, t, g.pitch) + xa, guess ? crow(guess, t, g.pitch) + fine : 0,
                           crow(rhs, t, g.pitch) + fine, correction ? crow(correction, t / 2, g.pitch2) + under : 0,
                           correction ? crow(correction, (t + 1) / 2, g.pitch2) + under : 0, AHEAD * g.pitch,
                           g.screening};
            row_t o = inside ? row(out, y, g.pitch) + fine : 0;
            if (c == 0 && edge) wave_row(ring, g, in, o, t, entering, m, out_a, out_end, w, 0, 1);
            if (c == 0 && !edge) wave_row(ring, g, in, o, t, entering, m, out_a, out_end, w, 0, 0);
            if (c == 1 && edge) wave_row(ring, g, in, o, t, entering, m, out_a, out_end, w, 1, 1);
            if (c == 1 && !edge) wave_row(ring, g, in, o, t, entering, m, out_a, out_end, w, 1, 0);
            mirror_columns(ring, g, t, m, left, right, c);
            y = t - CHEBYSHEV_SWEEPS - 1;
            int centre = (y & 1) ? y - 1 : (y == n - 1 ? y : -1);
            if (coarse && centre >= y0 && centre < y1) {
                row_t own = OWN(c);
                restrict_lane(row(coarse, centre / 2, g.pitch2) + under - xa / 2 + x0 / 2, RESIDUAL(own, mirror(centre - 1, n)), RESIDUAL(own, centre),
                              RESIDUAL(own, mirror(centre + 1, n)), TEMP(own), out_a, m, left, right, x1 == n ? n / 2 + 1 - x0 / 2 : (x1 - x0) / 2);
            }
        }
    }
}

// Global size (strips); d is shared by the channels. `rows` is even. Blocks of columns one after the other.
kernel void visit(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse, int n, int pitch,
                  int pitch2, int channels, int stride, int stride2, float screening, row_t scratch, int scratch_stride,
                  int rows, constant float *weights) {
    int s = get_global_id(0), y0 = s * rows, y1 = min(n, y0 + rows);
    level_t g = {n, pitch, pitch2, channels, stride, stride2, screening};
    if (y0 >= n) return;
    for (int x0 = 0; x0 < n - 1; x0 += BLOCK)
        visit_block(guess, correction, rhs, d, out, coarse, g, scratch + (size_t)s * scratch_stride, y0, y1, x0,
                    x0 + BLOCK < n - 1 ? x0 + BLOCK : n, weights);
}

// coarse = R fine. Global size (strips, channels).
kernel void restriction(crow_t fine, row_t coarse, int n, int pitch, int pitch2, int stride, int stride2, row_t scratch,
                        int scratch_stride, int rows) {
    int s = get_global_id(0), c = get_global_id(1), nc = n / 2 + 1;
    row_t tmp = scratch + (size_t)(c * get_global_size(0) + s) * scratch_stride + PAD;
    fine += (size_t)c * stride;
    for (int J = s * rows; J < min(nc, (s + 1) * rows); J++)
        restrict_row(row(coarse + (size_t)c * stride2, J, pitch2), crow(fine, mirror(2 * J - 1, n), pitch),
                     crow(fine, 2 * J, pitch), crow(fine, mirror(2 * J + 1, n), pitch), tmp, n);
}

// coarse = R (rhs - A u) of a level that fits a lane.
FORCE_INLINE void restrict_residual(row_t u, crow_t rhs, crow_t d, row_t coarse, level_t g, row_t ring) {
    int n = g.n;
    for (int y = 0; y < n; y++) ghosts(row(u, y, g.pitch), n);
    for (int y = 0; y < n; y++) {
        row_t here = row(u, y, g.pitch), r = ring + (y & 3) * LANE + PAD;
        crow_t f = crow(rhs, y, g.pitch), dr = crow(d, y, g.pitch), south = crow(u, mirror(y - 1, n), g.pitch);
        crow_t north = crow(u, mirror(y + 1, n), g.pitch);
        for (int x = 0; x < n; x += VW) {
            float16 c = load16(here + x), dv = load16(dr + x);
            float16 across = (load16(here + x - 1) - c) + (load16(here + x + 1) - c);
            float16 v = fma(-(dv + g.screening), c, across + ((load16(south + x) - c) + load16(f + x))) + (load16(north + x) - c);
            store16(select(v, (float16)(0.0f), dv < 0.0f), r + x);
        }
        int centre = (y & 1) ? y - 1 : (y == n - 1 ? y : -1);
        if (centre >= 0)
            restrict_row(row(coarse, centre / 2, g.pitch2), ring + (mirror(centre - 1, n) & 3) * LANE + PAD, ring + (centre & 3) * LANE + PAD, ring + (mirror(centre + 1, n) & 3) * LANE + PAD,
                         ring + 4 * LANE + PAD, n);
    }
}

FORCE_INLINE void relax_coarsest(row_t u, crow_t b, crow_t d, level_t g) {
    for (int y = 0; y < g.n; y++)
        for (int x = -PAD; x < g.pitch - PAD; x++) row(u, y, g.pitch)[x] = 0.0f;
    for (int s = 0; s < COARSEST_SWEEPS; s++)
        for (int y = 0; y < g.n; y++)
            for (int x = 0; x < g.n; x++) {
                row_t r = row(u, y, g.pitch);
                float around = row(u, mirror(y - 1, g.n), g.pitch)[x] + row(u, mirror(y + 1, g.n), g.pitch)[x] +
                               r[mirror(x - 1, g.n)] + r[mirror(x + 1, g.n)];
                float value = (crow(b, y, g.pitch)[x] + around) / (4.0f + crow(d, y, g.pitch)[x] + g.screening);
                r[x] += COARSEST_RELAXATION * (value - r[x]);
            }
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
        level_t of_k = {tab[4 * k + 1], tab[4 * k + 2], k < levels ? tab[4 * k + 6] : 0, 1, 0, 0, screening};
        g[k] = of_k;
        screening *= 4.0f;
    }
    for (int y = 0; y < g[0].n; y++)
        for (int x = 0; x < g[0].n; x += VW) {
            float16 held = load16(crow(rhs, y, g[0].pitch) + x);
            store16(select((float16)(0.0f), held, load16(crow(d, y, g[0].pitch) + x) < 0.0f), row(out, y, g[0].pitch) + x);
        }
    for (int i = 0; i < cycles; i++) {
        for (int k = 0; k < levels; k++) {
            int o = tab[4 * k], o2 = tab[4 * k + 4];
            if (k == 0)
                restrict_residual(out, rhs, d, work + o2, g[0], ring);
            else
                for (int J = 0; J < g[k + 1].n; J++)
                    restrict_row(row(work + o2, J, g[k].pitch2), crow(work + o, mirror(2 * J - 1, g[k].n), g[k].pitch),
                                 crow(work + o, 2 * J, g[k].pitch), crow(work + o, mirror(2 * J + 1, g[k].n), g[k].pitch),
                                 ring + PAD, g[k].n);
        }
        int o = tab[4 * levels];
        relax_coarsest(out + o, work + o, d + o, g[levels]);
        for (int k = levels - 1; k >= 0; k--) {
            int at = tab[4 * k], under = tab[4 * k + 4];
            visit_block(k ? 0 : out, out + under, k ? work + at : rhs, d + at, out + at, 0, g[k], ring, 0, g[k].n, 0,
                        g[k].n, weights);
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
            float v[VW];
            vstore16(m, 0, v);
            for (int i = 0; i < VW; i++) most = fmax(most, v[i]);
            for (; x < n; x++) most = fmax(most, fabs(p[x] - q[x]));
        }
    out[s] = most;
}
