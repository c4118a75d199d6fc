// What the ground over a base owes to it, row by row; after rows.cl. Twin: reference.over_base.
//
// In bands strokes prescribe the gradient of the ground, base included (`share` 1); beyond, the gradient of what lies above
// the base is diffused (0). So on every edge share times the base's own difference is taken off the guidance: exactly, to the
// finest detail of the base. Windows agree to the bit: no contraction, the same operations everywhere.
#pragma OPENCL FP_CONTRACT OFF

inline float16 edge_over_base(float16 s, float16 b, crow_t share, crow_t base) {
    return 0.5f * (s + vload16(0, share)) * (vload16(0, base) - b);
}

// f = raw + sum over the neighbours of the mean share of both ends times the difference of the base; at fixed samples raw.
// Rows [from, to) of n rows and `columns` columns whose ends are mirrored. Global size (strips of `each` rows).
kernel void over_base(crow_t base, crow_t share, crow_t d, crow_t raw, row_t f, int n, int columns, int pitch, int from,
                      int to, int each) {
    int first = from + (int)get_global_id(0) * each;
    for (int y = first; y < min(to, first + each); y++) {
        crow_t b = crow(base, y, pitch), s = crow(share, y, pitch), dr = crow(d, y, pitch), fr = crow(raw, y, pitch);
        int south = mirror(y - 1, n), north = mirror(y + 1, n);
        crow_t bs = crow(base, south, pitch), bn = crow(base, north, pitch);
        crow_t ss = crow(share, south, pitch), sn = crow(share, north, pitch);
        row_t out = row(f, y, pitch);
        for (int x = 0; x < columns; x += VW) {
            float16 here = vload16(0, b + x), mine = vload16(0, s + x), fv = vload16(0, fr + x);
            float16 along = edge_over_base(mine, here, ss + x, bs + x) + edge_over_base(mine, here, sn + x, bn + x);
            float16 across =
                edge_over_base(mine, here, s + x - 1, b + x - 1) + edge_over_base(mine, here, s + x + 1, b + x + 1);
            vstore16(select(fv + (along + across), fv, vload16(0, dr + x) < 0.0f), 0, out + x);
        }
        for (int e = 0; e < 2; e++) {
            int x = e ? columns - 1 : 0, i = e ? columns - 2 : 1;
            float along = 0.5f * (s[x] + ss[x]) * (bs[x] - b[x]) + 0.5f * (s[x] + sn[x]) * (bn[x] - b[x]);
            float across = 0.5f * (s[x] + s[i]) * (b[i] - b[x]);
            out[x] = dr[x] < 0.0f ? fr[x] : fr[x] + (along + (across + across));
        }
    }
}
