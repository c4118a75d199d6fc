// Refinement of a window above the global levels, row by row (DESIGN 5.6); after rows.cl. Twin:
// backend/esker/solve/refine/engine.py (NumpyEngine).
//
// A window is `rows` x `columns` samples of a level, laid out like a level (rows.cl); it begins on a bin, so on an even
// sample. Channels: d/dx, d/dy, height. Where the window ends on the border of the level, mirroring is the operator's own;
// elsewhere it gives wrong samples that the halo keeps away from what is read. Sums are written with fma and without
// contraction, and every sample of a row takes the same instructions: overlapping windows agree to the bit.
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
    int rows, columns, pitch, stride;
} window_t;

// Samples 2 i and 2 i + 1 of eight parent samples i: the cubic through four.
inline float16 widen(crow_t p) {
    float8 here = vload8(0, p);
    float8 between = 0.0625f * fma((float8)(9.0f), here + vload8(0, p + 1), -(vload8(0, p - 1) + vload8(0, p + 2)));
    float16 out;
    out.even = here;
    out.odd = between;
    return out;
}

// u = cubic prolongation of the parent, at fixed samples their value; q = inverse diagonals. parent: three channels of
// rows parent_pitch apart, beginning one sample south and west of the window. q: of the gradient and of the height
// equation. Global size (strips of `each` rows, 3).
kernel void refine_start(global const float *parent, int parent_pitch, int parent_stride, crow_t gradient_d,
                         crow_t height_d, crow_t height_f, row_t u, row_t q, int rows, int columns, int pitch, int stride,
                         float screening, int each) {
    int c = get_global_id(1), first = get_global_id(0) * each, height = c == 2;
    parent += (size_t)c * parent_stride;
    u += (size_t)c * stride;
    if (c == 1) q += stride;
    for (int y = first; y < min(rows, first + each); y++) {
        global const float *p = parent + (size_t)(y / 2 + 1) * parent_pitch + 1;
        row_t to = row(u, y, pitch), inverse = row(q, y, pitch);
        crow_t d = crow(c == 1 ? height_d : gradient_d, y, pitch), fixed = crow(height_d, y, pitch),
               value = crow(height_f, y, pitch);
        for (int x = 0; x < columns; x += VW, p += VW / 2) {
            float16 v = widen(p);
            if (y & 1) {
                float16 outer = widen(p - parent_pitch) + widen(p + 2 * parent_pitch);
                v = 0.0625f * fma((float16)(9.0f), v + widen(p + parent_pitch), -outer);
            }
            if (height) v = select(v, vload16(0, value + x), vload16(0, fixed + x) < 0.0f);
            vstore16(v, 0, to + x);
            if (c < 2) {
                float16 dv = vload16(0, d + x);
                vstore16(select(1.0f / (4.0f + (dv + screening)), (float16)(0.0f), dv < 0.0f), 0, inverse + x);
            }
        }
        ghosts(to, columns);
    }
}

// One Jacobi sweep of columns [x0, x1) of a row.
inline void sweep_row(row_t out, crow_t south, crow_t here, crow_t north, crow_t f, crow_t d, crow_t q, float screening,
                      float weight, int x0, int x1) {
    for (int x = x0; x < x1; x += VW) {
        float16 u = vload16(0, here + x), t = vload16(0, d + x) + screening;
        float16 sum = ((vload16(0, south + x) - u) + (vload16(0, north + x) - u)) +
                      ((vload16(0, here + x - 1) - u) + (vload16(0, here + x + 1) - u));
        vstore16(fma(weight * vload16(0, q + x), fma(-t, u, sum + vload16(0, f + x)), u), 0, out + x);
    }
}

// `sweeps` (even) weighted Jacobi sweeps of u, right on rows [y0, y1) and columns [x0, x1) of the window: sweep k does as
// many samples more on each side as sweeps follow it. v: a second array like u. As a wave: when sweep 0 does row t,
// sweep k does row t - k, and overwrites what sweep k - 2 left there. u, v: channel `channel` onwards; f from its
// beginning. d and q are shared. Global size (channels).
kernel void refine_sweeps(row_t u, row_t v, crow_t f, crow_t d, crow_t q, int channel, int q_channel, int rows,
                          int columns, int pitch, int stride, float screening, constant float *weights, int sweeps,
                          int y0, int y1, int x0, int x1) {
    int c = get_global_id(0);
    row_t at[2] = {u + (size_t)(channel + c) * stride, v + (size_t)(channel + c) * stride};
    f += (size_t)c * stride;
    q += (size_t)q_channel * stride;
    int first = max(0, y0 - sweeps + 1), last = min(rows, y1 + sweeps - 1);
    for (int t = first; t < last + sweeps; t++)
        for (int k = 0; k < sweeps; k++) {
            int y = t - k, more = sweeps - 1 - k;
            if (y < max(0, y0 - more) || y >= min(rows, y1 + more)) continue;
            row_t from = at[k & 1], to = row(at[(k + 1) & 1], y, pitch);
            sweep_row(to, crow(from, mirror(y - 1, rows), pitch), crow(from, y, pitch),
                      crow(from, mirror(y + 1, rows), pitch), crow(f, y, pitch), crow(d, y, pitch), crow(q, y, pitch),
                      screening, weights[k], max(0, x0 - more) & -VW, min(columns, x1 + more));
            ghosts(to, columns);
        }
}

// rhs = f - spacing * div g, at fixed samples f; g: channels 0 and 1 of u. At the window's ends the row of the operator
// is doubled. Global size (strips of `each` rows).
kernel void refine_guide(crow_t u, crow_t d, crow_t f, row_t rhs, int rows, int columns, int pitch, int stride,
                         float spacing, int each) {
    int first = get_global_id(0) * each;
    crow_t h = u + stride;
    for (int y = first; y < min(rows, first + each); y++) {
        crow_t g = crow(u, y, pitch), south = crow(h, max(y - 1, 0), pitch), north = crow(h, min(y + 1, rows - 1), pitch);
        // at a border: minus the sum of the two, at the other one plus
        float sign = y == 0 ? 1.0f : -1.0f, factor = y == 0 ? -1.0f : y == rows - 1 ? 1.0f : -0.5f;
        if (y == rows - 1) sign = 1.0f;
        row_t to = row(rhs, y, pitch);
        crow_t fixed = crow(d, y, pitch), value = crow(f, y, pitch);
        for (int x = 0; x < columns; x += VW) {
            float16 across = -0.5f * (vload16(0, g + x + 1) - vload16(0, g + x - 1));
            float16 along = factor * fma((float16)(sign), vload16(0, south + x), vload16(0, north + x));
            float16 v = vload16(0, value + x);
            vstore16(select(fma((float16)(spacing), across + along, v), v, vload16(0, fixed + x) < 0.0f), 0, to + x);
        }
        if (crow(d, y, pitch)[0] >= 0.0f)
            to[0] = fma(spacing, -(g[0] + g[1]) + factor * fma(sign, south[0], north[0]), value[0]);
        int e = columns - 1;
        if (crow(d, y, pitch)[e] >= 0.0f)
            to[e] = fma(spacing, (g[e] + g[e - 1]) + factor * fma(sign, south[e], north[e]), value[e]);
    }
}
