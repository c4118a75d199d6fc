// The plain twins of gpu/visit.cl and gpu/bottom.cl: one launch a stage, one work-item a sample, everything in global
// memory. Tests hold the fused kernels against them, bit for bit; no solve runs them. After gpu/level.cl, gpu/setup.cl.
// Levels below level 0 lie behind it in the same buffers: `at` and `under` are where a level and the next coarser one
// begin. Global size of all: (columns, rows, channels), rounded up.

// out = guess + P correction, the correction only where not fixed. Without guess the start is zero, or rhs where fixed.
kernel void plain_start(cfield_t guess, cfield_t correction, cfield_t rhs, cfield_t d, field_t out, int n, int pitch,
                        int stride, int pitch2, int stride2, int at, int under) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= n || y >= n) return;
    size_t c = get_global_id(2), here = at + (size_t)y * pitch + x, mine = here + c * stride;
    int fixed = d[here] < 0.0f;
    float u = guess ? guess[mine] : (fixed ? rhs[mine] : 0.0f);
    if (correction && !fixed) u += prolonged(correction + under + c * stride2, y, x, pitch2);
    out[mine] = u;
}

inline float plain_residual_at(cfield_t u, float rhs, float d, int y, int x, int n, int pitch, float screening) {
    cfield_t row = u + (size_t)y * pitch;
    float south = u[(size_t)mirrored(y - 1, n) * pitch + x], north = u[(size_t)mirrored(y + 1, n) * pitch + x];
    float s = sum_of_differences(south, north, row[mirrored(x - 1, n)], row[mirrored(x + 1, n)], row[x]) + rhs;
    return fma(-(d + screening), row[x], s);
}

// out = one Chebyshev sweep of weight w of u.
kernel void plain_sweep(cfield_t u, cfield_t rhs, cfield_t d, field_t out, int n, int pitch, int stride, int at,
                        float screening, float w) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= n || y >= n) return;
    size_t c = get_global_id(2), here = at + (size_t)y * pitch + x, mine = here + c * stride;
    float r = plain_residual_at(u + at + c * stride, rhs[mine], d[here], y, x, n, pitch, screening);
    out[mine] = fma(w * inverse_diagonal(d[here], screening), r, u[mine]);
}

// out = rhs - A u, zero at fixed samples.
kernel void plain_residual(cfield_t u, cfield_t rhs, cfield_t d, field_t out, int n, int pitch, int stride, int at,
                           float screening) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= n || y >= n) return;
    size_t c = get_global_id(2), here = at + (size_t)y * pitch + x, mine = here + c * stride;
    float r = plain_residual_at(u + at + c * stride, rhs[mine], d[here], y, x, n, pitch, screening);
    out[mine] = d[here] < 0.0f ? 0.0f : r;
}

// coarse = R fine.
kernel void plain_restriction(cfield_t fine, field_t coarse, int n, int pitch, int stride, int pitch2, int stride2, int at,
                              int under) {
    int X = get_global_id(0), Y = get_global_id(1);
    if (X > n / 2 || Y > n / 2) return;
    size_t c = get_global_id(2);
    coarse[under + c * stride2 + (size_t)Y * pitch2 + X] = restriction_at(fine + at + c * stride, Y, X, n, pitch);
}

// out = matrix rhs on the coarsest level, whose samples are dense.
kernel void plain_coarsest(cfield_t matrix, cfield_t rhs, field_t out, int n, int pitch, int stride, int at) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= n || y >= n) return;
    size_t c = get_global_id(2), begin = at + c * stride;
    float sum = 0.0f;
    for (int j = 0; j < n * n; j++)
        sum = fma(matrix[(y * n + x) * n * n + j], rhs[begin + (size_t)(j / n) * pitch + j % n], sum);
    out[begin + (size_t)y * pitch + x] = sum;
}
