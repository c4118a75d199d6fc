// The fused level visit (DESIGN 5.3): prolong the correction, sweep, restrict the residual, in one pass over a strip of
// rows. Twin: reference.visit. One work-item runs a wave down its strip: when row t has entered, sweep k can do row t-k,
// so all sweeps of a row happen while it is in cache. Strips repeat a few rows of their neighbours and agree to the bit.
#define STAGES (CHEBYSHEV_SWEEPS + 2)
#define RING_ROWS (4 * STAGES + 16 + 1)

typedef struct {
    int n, pitch, pitch2;
    float screening;
} level_t;

// q = 1 / (4 + d + screening), or 0 where fixed, and e = q * (d + screening): what a sweep needs of the operator.
inline void operator_row(row_t q, row_t e, crow_t d, level_t g) {
    for (int x = 0; x < g.n; x += VW) {
        float16 dv = vload16(0, d + x), total = dv + g.screening;
        float16 qv = select(1.0f / (4.0f + total), (float16)(0.0f), dv < 0.0f);
        vstore16(qv, 0, q + x);
        vstore16(qv * total, 0, e + x);
    }
}

// out = start + P (mean of c0, c1), the correction only where not fixed. Without guess the start is zero, or fixed.
inline void enter_row(row_t out, crow_t guess, crow_t d, crow_t fixed, crow_t c0, crow_t c1, int n) {
    for (int x = 0; x < n; x += 2 * VW) {
        float16 u[2] = {(float16)(0.0f), (float16)(0.0f)};
        if (c0) {
            float16 c = 0.5f * (vload16(0, c0 + x / 2) + vload16(0, c1 + x / 2));
            float16 b = 0.5f * (vload16(0, c0 + x / 2 + 1) + vload16(0, c1 + x / 2 + 1)), m = 0.5f * (c + b);
            u[0] = (float16)(c.s0, m.s0, c.s1, m.s1, c.s2, m.s2, c.s3, m.s3, c.s4, m.s4, c.s5, m.s5, c.s6, m.s6, c.s7, m.s7);
            u[1] = (float16)(c.s8, m.s8, c.s9, m.s9, c.sa, m.sa, c.sb, m.sb, c.sc, m.sc, c.sd, m.sd, c.se, m.se, c.sf, m.sf);
        }
        for (int i = 0; i < 2; i++) {
            int at = x + i * VW;
            float16 base = guess ? vload16(0, guess + at) : (float16)(0.0f);
            float16 held = guess ? base : vload16(0, fixed + at);
            vstore16(select(base + u[i], held, vload16(0, d + at) < 0.0f), 0, out + at);
        }
    }
}

inline float16 sum_of_differences(crow_t south, crow_t here, crow_t north, int x, float16 c) {
    return (vload16(0, south + x) - c) + (vload16(0, north + x) - c) +
           ((vload16(0, here + x - 1) - c) + (vload16(0, here + x + 1) - c));
}

inline void sweep_row(row_t out, crow_t south, crow_t here, crow_t north, crow_t rhs, crow_t q, crow_t e, float w, int n) {
    for (int x = 0; x < n; x += VW) {
        float16 c = vload16(0, here + x);
        float16 s = sum_of_differences(south, here, north, x, c) + vload16(0, rhs + x);
        vstore16(c + w * (vload16(0, q + x) * s - vload16(0, e + x) * c), 0, out + x);
    }
}

inline void residual_row(row_t out, crow_t south, crow_t here, crow_t north, crow_t rhs, crow_t d, float screening, int n) {
    for (int x = 0; x < n; x += VW) {
        float16 c = vload16(0, here + x), dv = vload16(0, d + x);
        float16 r = sum_of_differences(south, here, north, x, c) + vload16(0, rhs + x) - (dv + screening) * c;
        vstore16(select(r, (float16)(0.0f), dv < 0.0f), 0, out + x);
    }
}

#define RING(k, y) (ring + ((k) * 4 + ((y) & 3)) * g.pitch + PAD)
#define QROW(y) (ring + (4 * STAGES + ((y) & 7)) * g.pitch + PAD)
#define EROW(y) (ring + (4 * STAGES + 8 + ((y) & 7)) * g.pitch + PAD)
#define TEMP (ring + (4 * STAGES + 16) * g.pitch + PAD)

// Rows [y0, y1) of out = K sweeps of (guess + P correction); coarse = R (rhs - A out) if given. guess, correction and
// coarse may be null. ring: RING_ROWS rows of scratch.
inline void visit_strip(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse, level_t g,
                        row_t ring, int y0, int y1, int K, constant float *weights) {
    int n = g.n, halo = K + (coarse ? 2 : 0), lo = max(0, y0 - halo), hi = min(n, y1 + halo);
    for (int t = lo; t < hi + K + 2; t++) {
        if (t < hi) {
            row_t u = RING(0, t);
            crow_t dr = crow(d, t, g.pitch);
            enter_row(u, guess ? crow(guess, t, g.pitch) : 0, dr, crow(rhs, t, g.pitch),
                      correction ? crow(correction, t / 2, g.pitch2) : 0,
                      correction ? crow(correction, (t + 1) / 2, g.pitch2) : 0, n);
            ghosts(u, n);
            if (K) operator_row(QROW(t), EROW(t), dr, g);
        }
        for (int k = 1; k <= K; k++) {
            int y = t - k;
            if (y < (lo ? lo + k : 0) || y >= (hi < n ? hi - k : n)) continue;
            row_t u = RING(k, y);
            sweep_row(u, RING(k - 1, mirror(y - 1, n)), RING(k - 1, y), RING(k - 1, mirror(y + 1, n)),
                      crow(rhs, y, g.pitch), QROW(y), EROW(y), weights[k - 1], n);
            ghosts(u, n);
            if (k == K && y >= y0 && y < y1) {
                row_t o = row(out, y, g.pitch);
                for (int x = 0; x < n; x += VW) vstore16(vload16(0, u + x), 0, o + x);
            }
        }
        int y = t - K - 1;
        if (!coarse || y < max(0, y0 - 1) || y >= min(n, y1 + 1)) continue;
        residual_row(RING(K + 1, y), RING(K, mirror(y - 1, n)), RING(K, y), RING(K, mirror(y + 1, n)),
                     crow(rhs, y, g.pitch), crow(d, y, g.pitch), g.screening, n);
        int centre = (y & 1) ? y - 1 : (y == n - 1 ? y : -1);
        if (centre >= y0 && centre < y1)
            restrict_row(row(coarse, centre / 2, g.pitch2), RING(K + 1, mirror(centre - 1, n)), RING(K + 1, centre),
                         RING(K + 1, mirror(centre + 1, n)), TEMP, n);
    }
}

// Global size (strips, channels); d is shared by the channels. `rows` is even.
kernel void visit(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, row_t coarse, int n, int pitch,
                  int pitch2, int stride, int stride2, float screening, row_t scratch, int scratch_stride, int rows,
                  constant float *weights) {
    int s = get_global_id(0), c = get_global_id(1), y0 = s * rows, y1 = min(n, y0 + rows);
    size_t fine = (size_t)c * stride, under = (size_t)c * stride2;
    level_t g = {n, pitch, pitch2, screening};
    if (y0 < n)
        visit_strip(guess ? guess + fine : 0, correction ? correction + under : 0, rhs + fine, d, out + fine,
                    coarse ? coarse + under : 0, g, scratch + (size_t)(c * get_global_size(0) + s) * scratch_stride, y0,
                    y1, CHEBYSHEV_SWEEPS, weights);
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

inline void relax_coarsest(row_t u, crow_t b, crow_t d, level_t g) {
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
        level_t of_k = {tab[4 * k + 1], tab[4 * k + 2], k < levels ? tab[4 * k + 6] : 0, screening};
        g[k] = of_k;
        screening *= 4.0f;
    }
    for (int y = 0; y < g[0].n; y++)
        enter_row(row(out, y, g[0].pitch), 0, crow(d, y, g[0].pitch), crow(rhs, y, g[0].pitch), 0, 0, g[0].n);
    for (int i = 0; i < cycles; i++) {
        for (int k = 0; k < levels; k++) {
            int o = tab[4 * k], o2 = tab[4 * k + 4];
            if (k == 0)
                visit_strip(out, 0, rhs, d, out, work + o2, g[0], ring, 0, g[0].n, 0, weights);
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
            visit_strip(k ? 0 : out, out + under, k ? work + at : rhs, d + at, out + at, 0, g[k], ring, 0, g[k].n,
                        CHEBYSHEV_SWEEPS, weights);
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
            for (; x + VW <= n; x += VW) m = fmax(m, fabs(vload16(0, p + x) - vload16(0, q + x)));
            float v[16];
            vstore16(m, 0, v);
            for (int i = 0; i < VW; i++) most = fmax(most, v[i]);
            for (; x < n; x++) most = fmax(most, fabs(p[x] - q[x]));
        }
    out[s] = most;
}
