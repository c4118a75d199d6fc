// What the ground over a base owes to it, on a GPU; after gpu_level.cl. See over_base.cl. Twin: reference.over_base.

inline float edge_over_base(cfield_t base, cfield_t share, size_t at, size_t to) {
    return 0.5f * (share[at] + share[to]) * (base[to] - base[at]);
}

// Rows [from, to). Global size (columns, to - from), rounded up.
kernel void over_base(cfield_t base, cfield_t share, cfield_t d, cfield_t raw, field_t f, int n, int pitch, int from,
                      int to) {
    int x = get_global_id(0), y = from + (int)get_global_id(1);
    if (x >= n || y >= to) return;
    size_t row = (size_t)y * pitch, at = row + x;
    float along = edge_over_base(base, share, at, (size_t)mirrored(y - 1, n) * pitch + x) +
                  edge_over_base(base, share, at, (size_t)mirrored(y + 1, n) * pitch + x);
    float across = edge_over_base(base, share, at, row + mirrored(x - 1, n)) +
                   edge_over_base(base, share, at, row + mirrored(x + 1, n));
    f[at] = d[at] < 0.0f ? raw[at] : raw[at] + (along + across);
}
