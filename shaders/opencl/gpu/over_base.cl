// What the ground over a base owes to it, on a GPU; after gpu/level.cl. See over_base.cl. Twin: reference.over_base.

inline float edge_over_base(cfield_t base, cfield_t share, cfield_t target, size_t at, size_t to, float slack) {
    float step = base[to] - base[at], one = share[at] * step, two = share[to] * step, fall = target[at] - target[to];
    float low = fmin(one, two), high = fmax(one, two);
    float lesser = fmin(fabs(target[at]), fabs(target[to])) * (1.0f / BALANCE_M);
    float through = (target[at] < 0.0f) != (target[to] < 0.0f) ? fmin(lesser, 1.0f) : 0.0f;
    float taken = clamp(0.5f * (share[at] + share[to]) * step, fall - slack, fall + slack);
    return clamp(taken, low - through * fmax(low, 0.0f), high - through * fmin(high, 0.0f));
}

// Rows [from, to). Global size (columns, to - from), rounded up.
kernel void over_base(cfield_t base, cfield_t share, cfield_t target, cfield_t d, cfield_t raw, field_t f, float slack, int n,
                      int pitch, int from, int to) {
    int x = get_global_id(0), y = from + (int)get_global_id(1);
    if (x >= n || y >= to) return;
    size_t row = (size_t)y * pitch, at = row + x;
    float along = edge_over_base(base, share, target, at, (size_t)mirrored(y - 1, n) * pitch + x, slack) +
                  edge_over_base(base, share, target, at, (size_t)mirrored(y + 1, n) * pitch + x, slack);
    float across = edge_over_base(base, share, target, at, row + mirrored(x - 1, n), slack) +
                   edge_over_base(base, share, target, at, row + mirrored(x + 1, n), slack);
    f[at] = d[at] < 0.0f ? raw[at] : raw[at] + (along + across);
}
