// The steps of the fused visit (visit.cl) one by one, a sample a work-item: its twin, to the bit, for tests. Needs
// rows.cl. A level is as there; one channel. Global size (n, n), restriction (n / 2 + 1, n / 2 + 1).

inline size_t sample(int y, int x, int pitch) { return (size_t)y * pitch + PAD + x; }

// out = guess + P correction, the correction only where not fixed. Without guess the start is zero, or fixed.
kernel void plain_start(crow_t guess, crow_t correction, crow_t rhs, crow_t d, row_t out, int pitch, int pitch2) {
    int x = get_global_id(0), y = get_global_id(1);
    size_t at = sample(y, x, pitch);
    float start = guess ? guess[at] : 0.0f, held = guess ? start : rhs[at];
    if (correction) {
        crow_t c0 = correction + sample(y / 2, x / 2, pitch2), c1 = correction + sample((y + 1) / 2, x / 2, pitch2);
        float two = c0[0] + c1[0];
        start = (x & 1) ? fma(two + (c0[1] + c1[1]), 0.25f, start) : fma(two, 0.5f, start);
    }
    out[at] = d[at] < 0.0f ? held : start;
}

// rhs - A u, whatever is fixed.
inline float defect(crow_t u, crow_t rhs, crow_t d, int y, int x, int n, int pitch, float screening) {
    size_t at = sample(y, x, pitch);
    float c = u[at], south = u[sample(mirror(y - 1, n), x, pitch)], north = u[sample(mirror(y + 1, n), x, pitch)];
    float west = u[sample(y, mirror(x - 1, n), pitch)], east = u[sample(y, mirror(x + 1, n), pitch)];
    float rest = ((east - c) - (c - west)) + ((south - c) + rhs[at]);
    return fma(-(d[at] + screening), c, rest) + (north - c);
}

// One Chebyshev-Jacobi sweep.
kernel void plain_sweep(crow_t u, crow_t rhs, crow_t d, row_t out, int n, int pitch, float screening, float weight) {
    int x = get_global_id(0), y = get_global_id(1);
    size_t at = sample(y, x, pitch);
    float q = d[at] < 0.0f ? 0.0f : 1.0f / (4.0f + (d[at] + screening));
    out[at] = fma(weight * q, defect(u, rhs, d, y, x, n, pitch, screening), u[at]);
}

kernel void plain_residual(crow_t u, crow_t rhs, crow_t d, row_t out, int n, int pitch, float screening) {
    int x = get_global_id(0), y = get_global_id(1);
    size_t at = sample(y, x, pitch);
    out[at] = d[at] < 0.0f ? 0.0f : defect(u, rhs, d, y, x, n, pitch, screening);
}

// Three fine rows at one column, by the weights of R.
inline float column(crow_t fine, int y, int x, int n, int pitch) {
    return fine[sample(y, x, pitch)] +
           0.5f * (fine[sample(mirror(y - 1, n), x, pitch)] + fine[sample(mirror(y + 1, n), x, pitch)]);
}

kernel void plain_restriction(crow_t fine, row_t coarse, int n, int pitch, int pitch2) {
    int x = 2 * get_global_id(0), y = 2 * get_global_id(1);
    float beside = column(fine, y, mirror(x + 1, n), n, pitch) + column(fine, y, mirror(x - 1, n), n, pitch);
    coarse[sample(y / 2, x / 2, pitch2)] = column(fine, y, x, n, pitch) + 0.5f * beside;
}
