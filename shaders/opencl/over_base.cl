// What the ground over a base owes to it, row by row; after rows.cl. Twin: reference.over_base.
//
// In bands strokes prescribe the gradient of the ground, base included (`share` 1); beyond, the gradient of what lies above
// the base is diffused (0). So on every edge a share of the base's own difference is taken off the guidance: exactly, to the
// finest detail of the base. Windows agree to the bit: no contraction, the same operations everywhere.
#pragma OPENCL FP_CONTRACT OFF

// The share on an edge is the mean of those at its ends. A cliff of the base in one step may leave a band: then the edge takes
// off what the band has there, to within `slack`, with a share between those at the ends; between a fill and a cut, of
// BALANCE_M each, it may be less than either.
inline float16 edge_over_base(float16 s, float16 b, float16 t, crow_t share, crow_t base, crow_t target, float slack) {
    float16 other = vload16(0, share), step = vload16(0, base) - b, t2 = vload16(0, target), fall = t - t2;
    float16 one = s * step, two = other * step, low = fmin(one, two), high = fmax(one, two), zero = 0.0f;
    float16 lesser = fmin(fmin(fabs(t), fabs(t2)) * (1.0f / BALANCE_M), 1.0f);
    float16 through = select(zero, lesser, (t < 0.0f) ^ (t2 < 0.0f));
    float16 taken = clamp(0.5f * (s + other) * step, fall - slack, fall + slack);
    return clamp(taken, low - through * fmax(low, zero), high - through * fmin(high, zero));
}

inline float edge_at(crow_t share, crow_t base, crow_t target, int x, crow_t share2, crow_t base2, crow_t target2, int x2,
                     float slack) {
    float s = share[x], other = share2[x2], step = base2[x2] - base[x], t = target[x], t2 = target2[x2], fall = t - t2;
    float one = s * step, two = other * step, low = fmin(one, two), high = fmax(one, two);
    float through = (t < 0.0f) != (t2 < 0.0f) ? fmin(fmin(fabs(t), fabs(t2)) * (1.0f / BALANCE_M), 1.0f) : 0.0f;
    float taken = clamp(0.5f * (s + other) * step, fall - slack, fall + slack);
    return clamp(taken, low - through * fmax(low, 0.0f), high - through * fmin(high, 0.0f));
}

// f = raw + sum over the neighbours of the edge's share times the difference of the base; at fixed samples raw.
// Rows [from, to) of n rows and `columns` columns whose ends are mirrored. Global size (strips of `each` rows).
kernel void over_base(crow_t base, crow_t share, crow_t target, crow_t d, crow_t raw, row_t f, float slack, int n,
                      int columns, int pitch, int from, int to, int each) {
    int first = from + (int)get_global_id(0) * each;
    for (int y = first; y < min(to, first + each); y++) {
        crow_t b = crow(base, y, pitch), s = crow(share, y, pitch), w = crow(target, y, pitch);
        crow_t dr = crow(d, y, pitch), fr = crow(raw, y, pitch);
        int south = mirror(y - 1, n), north = mirror(y + 1, n);
        crow_t bs = crow(base, south, pitch), bn = crow(base, north, pitch);
        crow_t ss = crow(share, south, pitch), sn = crow(share, north, pitch);
        crow_t ws = crow(target, south, pitch), wn = crow(target, north, pitch);
        row_t out = row(f, y, pitch);
        for (int x = 0; x < columns; x += VW) {
            float16 here = vload16(0, b + x), mine = vload16(0, s + x), want = vload16(0, w + x), fv = vload16(0, fr + x);
            float16 along = edge_over_base(mine, here, want, ss + x, bs + x, ws + x, slack) +
                            edge_over_base(mine, here, want, sn + x, bn + x, wn + x, slack);
            float16 across = edge_over_base(mine, here, want, s + x - 1, b + x - 1, w + x - 1, slack) +
                             edge_over_base(mine, here, want, s + x + 1, b + x + 1, w + x + 1, slack);
            vstore16(select(fv + (along + across), fv, vload16(0, dr + x) < 0.0f), 0, out + x);
        }
        for (int e = 0; e < 2; e++) {
            int x = e ? columns - 1 : 0, i = e ? columns - 2 : 1;
            float along = edge_at(s, b, w, x, ss, bs, ws, x, slack) + edge_at(s, b, w, x, sn, bn, wn, x, slack);
            float across = edge_at(s, b, w, x, s, b, w, i, slack);
            out[x] = dr[x] < 0.0f ? fr[x] : fr[x] + (along + (across + across));
        }
    }
}
