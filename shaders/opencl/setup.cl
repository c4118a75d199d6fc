// From rasterised constraints to the hierarchy of levels (DESIGN 5.3). Twins: reference.coarsen, reference.divergence,
// reference.held.

// The samples of one fine row, at every second of which a coarse one lies, that are at least so stiff.
FORCE_INLINE int16 even_from(crow_t r, float least) {
    float16 u = load16(r), v = load16(r + VW), e = (float16)(u.even, v.even);
    return e < 0.0f || e >= least;
}

// Coarse samples on a crest along one of the lines through them (reference.on_lines): `a`, `b`, `c` are rows 2J-1, 2J,
// 2J+1 of the stiffness, of which b has ghosts.
FORCE_INLINE int16 on_lines(crow_t a, crow_t b, crow_t c) {
    int16 west = even_from(b - 1, 0.5f * LINE_STIFFNESS), east = even_from(b + 1, 0.5f * LINE_STIFFNESS);
    int16 south = even_from(a, 0.5f * LINE_STIFFNESS), north = even_from(c, 0.5f * LINE_STIFFNESS);
    int16 strong = even_from(b, 0.5f * LINE_STIFFNESS) & ((west & east) | (south & north));
    west = even_from(b - 1, FIRM_STIFFNESS), east = even_from(b + 1, FIRM_STIFFNESS);
    south = even_from(a, FIRM_STIFFNESS), north = even_from(c, FIRM_STIFFNESS);
    int16 lone = (west & east & ~south & ~north) | (south & north & ~west & ~east);
    return strong | (even_from(b, FIRM_STIFFNESS) & lone);
}

// Springs of one coarse row: d' = S / (1 + SATURATION S), f' = R f / (1 + SATURATION S), S = R d. Fixed samples count
// as springs of CREST_STIFFNESS; a pinned border stays as good as fixed, a crest along a line nearly so. `tmp` holds four
// fine rows. d is written by channel 0 only.
inline void coarsen_row(crow_t d, crow_t f, row_t d2, row_t f2, int J, int n, int pitch, int pitch2, row_t tmp,
                        int write_d) {
    int ys[3] = {mirror(2 * J - 1, n), 2 * J, mirror(2 * J + 1, n)}, nc = n / 2 + 1;
    row_t sd = tmp + PAD, sf = tmp + pitch + PAD, middle = tmp + 2 * pitch + PAD;
    for (int x = 0; x < n; x += VW) {
        float16 ad = 0.0f, af = 0.0f;
        for (int i = 0; i < 3; i++) {
            float16 dv = load16(crow(d, ys[i], pitch) + x), fv = load16(crow(f, ys[i], pitch) + x);
            float16 fixed = select((float16)(1.0f), (float16)(CREST_STIFFNESS), dv < 0.0f);
            float w = i == 1 ? 1.0f : 0.5f;
            ad += w * HARD_VALUE(dv, CREST_STIFFNESS);
            af += w * fixed * fv;
            if (i == 1) store16(dv, middle + x);
        }
        store16(ad, sd + x);
        store16(af, sf + x);
    }
    ghosts(sd, n);
    ghosts(sf, n);
    ghosts(middle, n);
    row_t od = row(d2, J, pitch2), of = row(f2, J, pitch2);
    crow_t south = crow(d, ys[0], pitch), north = crow(d, ys[2], pitch), value = crow(f, 2 * J, pitch);
    for (int x = 0; x < nc; x += VW) {
        float16 s[2];
        for (int i = 0; i < 2; i++) {
            row_t r = (i ? sf : sd) + 2 * x;
            float16 u = load16(r), v = load16(r + VW), l = load16(r - 1), m = load16(r + VW - 1);
            s[i] = (float16)(u.even + 0.5f * (u.odd + l.even), v.even + 0.5f * (v.odd + m.even));
        }
        float16 k = 1.0f / (1.0f + SATURATION * s[0]), u = load16(middle + 2 * x), v = load16(middle + 2 * x + VW);
        float16 here = (float16)(u.even, v.even), a = load16(value + 2 * x), b = load16(value + 2 * x + VW);
        float16 target = (float16)(a.even, b.even) * select(1.0f / fmax(here, 1.0f), (float16)(1.0f), here < 0.0f);
        int16 pinned = here <= PINNED || here >= 0.5f * PINNED_STIFFNESS;
        int16 line = on_lines(south + 2 * x, middle + 2 * x, north + 2 * x);
        float16 dk = select(s[0] * k, (float16)(LINE_STIFFNESS), line), fk = select(s[1] * k, LINE_STIFFNESS * target, line);
        if (write_d) store16(select(dk, (float16)(PINNED_STIFFNESS), pinned), od + x);
        store16(select(fk, (float16)(0.0f), pinned), of + x);
    }
}

// Coarse rows [from, to). Global size (strips, channels).
kernel void coarsen(crow_t d, crow_t f, row_t d2, row_t f2, int n, int pitch, int pitch2, int stride, int stride2,
                    row_t scratch, int scratch_stride, int rows, int from, int to) {
    int s = get_global_id(0), c = get_global_id(1);
    row_t tmp = scratch + (size_t)(c * get_global_size(0) + s) * scratch_stride;
    for (int J = from + s * rows; J < min(to, from + (s + 1) * rows); J++)
        coarsen_row(d, f + (size_t)c * stride, d2, f2 + (size_t)c * stride2, J, n, pitch, pitch2, tmp, c == 0);
}

// The levels below level 0, by one work-item: they lie behind level 0 in the same buffers.
// tab[4 k]: offset, n, pitch of level -k.
kernel void coarsen_bottom(row_t d, row_t f, constant int *tab, int levels, int channels, int stride, row_t scratch) {
    for (int k = 0; k < levels; k++) {
        constant int *a = tab + 4 * k, *b = a + 4;
        for (int c = 0; c < channels; c++)
            for (int J = 0; J < b[1]; J++)
                coarsen_row(d + a[0], f + (size_t)c * stride + a[0], d + b[0], f + (size_t)c * stride + b[0], J, a[1],
                            a[2], b[2], scratch, c == 0);
    }
}

// u = f where fixed. Global size (strips).
kernel void hold_fixed(crow_t f, crow_t d, row_t u, int n, int pitch, int rows) {
    int s = get_global_id(0);
    for (int y = s * rows; y < min(n, (s + 1) * rows); y++)
        for (int x = 0; x < n; x += VW) {
            row_t o = row(u, y, pitch) + x;
            store16(select(load16(o), load16(crow(f, y, pitch) + x), load16(crow(d, y, pitch) + x) < 0.0f), o);
        }
}

inline float16 half_difference(float16 before, float16 after) { return -0.5f * (after - before); }

// rhs = f - spacing * div g, at fixed samples f. g: two channels `stride` apart. Global size (strips).
kernel void divergence(crow_t f, crow_t d, crow_t g, row_t rhs, int n, int pitch, int stride, float spacing, int rows) {
    int s = get_global_id(0);
    for (int y = s * rows; y < min(n, (s + 1) * rows); y++) {
        crow_t gx = crow(g, y, pitch), gy = crow(g + stride, y, pitch), dr = crow(d, y, pitch), fr = crow(f, y, pitch);
        crow_t gs = crow(g + stride, max(y - 1, 0), pitch), gn = crow(g + stride, min(y + 1, n - 1), pitch);
        float up = y == 0 ? -1.0f : (y == n - 1 ? 1.0f : 0.0f);
        row_t out = row(rhs, y, pitch);
        for (int x = 0; x < n; x += VW) {
            float16 across = half_difference(load16(gx + x - 1), load16(gx + x + 1));
            float16 north = load16(gn + x), south = load16(gs + x);
            float16 along = up == 0.0f ? half_difference(south, north) : up * (south + north);
            float16 fv = load16(fr + x);
            store16(select(fv + spacing * (across + along), fv, load16(dr + x) < 0.0f), out + x);
        }
        // at the west and east border the row of the operator is doubled
        for (int e = 0; e < 2; e++) {
            int x = e ? n - 1 : 0, i = e ? n - 2 : 1;
            float across = (e ? 1.0f : -1.0f) * (gx[x] + gx[i]);
            float along = up == 0.0f ? -0.5f * (gn[x] - gs[x]) : up * (gs[x] + gn[x]);
            if (dr[x] >= 0.0f) out[x] = fr[x] + spacing * (across + along);
        }
    }
}
