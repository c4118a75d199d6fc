// Level 0 and the levels below it by one work-group a channel, all in local memory (DESIGN 5.3). Twins: reference.bottom,
// reference.relaxation_matrix. In global memory the levels lie behind each other: tab[4 k] is offset, n, pitch of level -k.
#define SIDE(k) ((TILE_CELLS >> (k)) + 1)
#define OWNED ((SIDE(0) * SIDE(0) + BOTTOM_ITEMS - 1) / BOTTOM_ITEMS)
#define COARSEST SIDE(BOTTOM_LEVELS)

// Area of the control volume of a sample of the coarsest level, in cells.
inline float control_volume(int i) {
    int y = i / COARSEST, x = i % COARSEST;
    return (y == 0 || y == COARSEST - 1 ? 0.5f : 1.0f) * (x == 0 || x == COARSEST - 1 ? 0.5f : 1.0f);
}

// Constraints of the levels below level 0, then the linear map of COARSEST_SWEEPS over-relaxations from the constant that
// balances the load (reference.relaxation_matrix) on the coarsest, a column by a work-item: a GPU would take as long for
// one relaxation as for all the levels above. One work-group.
kernel __attribute__((reqd_work_group_size(BOTTOM_ITEMS, 1, 1)))
void coarsen_bottom(field_t d, field_t f, field_t matrix, constant int *tab, int channels, int stride, float screening) {
    int lid = get_local_id(0);
    for (int k = 0; k < BOTTOM_LEVELS; k++) {
        int a = tab[4 * k], b = tab[4 * k + 4], n = tab[4 * k + 5];
        level_t g = {tab[4 * k + 1], tab[4 * k + 2], stride, tab[4 * k + 6], stride, 0.0f};
        for (int i = lid; i < n * n; i += BOTTOM_ITEMS) coarsen_at(d + a, f + a, d + b, f + b, i / n, i % n, channels, g);
        barrier(CLK_GLOBAL_MEM_FENCE);
        screening *= 4.0f;
    }
    cfield_t dc = d + tab[4 * BOTTOM_LEVELS];
    int pitch = tab[4 * BOTTOM_LEVELS + 2];
    float stiffness = 0.0f;
    for (int i = 0; i < COARSEST * COARSEST; i++)
        stiffness = fma(control_volume(i), dc[i / COARSEST * pitch + i % COARSEST] + screening, stiffness);
    for (int column = lid; column < COARSEST * COARSEST; column += BOTTOM_ITEMS) {
        float u[COARSEST * COARSEST], total = 0.0f, start = 0.0f;
        if (stiffness > LEAST_HOLD) start = control_volume(column) / stiffness;
        for (int i = 0; i < COARSEST * COARSEST; i++) u[i] = start;
        for (int s = 0; s < COARSEST_SWEEPS; s++)
            for (int i = 0; i < COARSEST * COARSEST; i++) {
                int y = i / COARSEST, x = i % COARSEST;
                float around = (u[mirrored(y - 1, COARSEST) * COARSEST + x] + u[mirrored(y + 1, COARSEST) * COARSEST + x]) +
                               (u[y * COARSEST + mirrored(x - 1, COARSEST)] + u[y * COARSEST + mirrored(x + 1, COARSEST)]);
                float value = ((i == column ? 1.0f : 0.0f) + around) / (4.0f + dc[y * pitch + x] + screening);
                u[i] = fma(COARSEST_RELAXATION, value - u[i], u[i]);
            }
        for (int i = 0; i < COARSEST * COARSEST; i++) total = fma(control_volume(i), u[i], total);
        if (stiffness > LEAST_HOLD) total = 0.0f;
        for (int i = 0; i < COARSEST * COARSEST; i++)
            matrix[i * COARSEST * COARSEST + column] = u[i] - total / ((COARSEST - 1) * (COARSEST - 1));
    }
}

// i / n for the few thousand samples of a level: a division of integers costs a GPU more than a whole sweep.
inline int row_of(int i, int n) { return (int)((i + 0.5f) * (1.0f / n)); }

inline float differences_at(local const float *u, int n, int i) {
    int y = row_of(i, n), x = i - y * n;
    float south = u[y > 0 ? i - n : i + n], north = u[y < n - 1 ? i + n : i - n];
    return sum_of_differences(south, north, u[x > 0 ? i - 1 : i + 1], u[x < n - 1 ? i + 1 : i - 1], u[i]);
}

// out = R fine, both dense in local memory.
inline void restrict_local(local float *out, local const float *fine, int n) {
    int nc = n / 2 + 1;
    for (int i = get_local_id(0); i < nc * nc; i += BOTTOM_ITEMS) {
        int Y = row_of(i, nc), y = 2 * Y, x = 2 * (i - Y * nc), west = mirrored(x - 1, n), east = mirrored(x + 1, n);
        local const float *a = fine + mirrored(y - 1, n) * n, *b = fine + y * n, *c = fine + mirrored(y + 1, n) * n;
        out[i] = restricted(b[x], (a[x] + c[x]) + (b[west] + b[east]), (a[west] + c[east]) + (a[east] + c[west]));
    }
}

// u = sweeps of (u + P correction), from the right-hand side in global (level 0) or local memory. With `zero` u starts
// from nothing. All dense but d and rhs; a work-item owns every BOTTOM_ITEMS-th sample.
inline void relax_local(local float *u, local const float *correction, cfield_t rhs, local const float *b, cfield_t d,
                        int n, int pitch, float screening, int zero, constant float *weights) {
    float f[OWNED], t[OWNED], q[OWNED], v[OWNED];
    int lid = get_local_id(0), nc = n / 2 + 1;
    for (int o = 0; o < OWNED; o++) {
        int i = lid + o * BOTTOM_ITEMS;
        if (i >= n * n) continue;
        int y = row_of(i, n), x = i - y * n, east = x & 1;
        float dv = d[y * pitch + x];
        f[o] = rhs ? rhs[y * pitch + x] : b[i];
        t[o] = dv + screening;
        q[o] = inverse_diagonal(dv, screening);
        local const float *s = correction + (y / 2) * nc + x / 2, *m = correction + ((y + 1) / 2) * nc + x / 2;
        float p = dv < 0.0f ? 0.0f : 0.25f * ((s[0] + s[east]) + (m[0] + m[east]));
        u[i] = zero ? p : u[i] + p;
    }
    for (int k = 0; k < CHEBYSHEV_SWEEPS; k++) {
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int o = 0; o < OWNED; o++) {
            int i = lid + o * BOTTOM_ITEMS;
            if (i < n * n) v[o] = fma(weights[k] * q[o], fma(-t[o], u[i], differences_at(u, n, i) + f[o]), u[i]);
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int o = 0; o < OWNED; o++) {
            int i = lid + o * BOTTOM_ITEMS;
            if (i < n * n) u[i] = v[o];
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

// b = R (rhs - A u) on level 0, u unchanged: the residual takes its place for a moment.
inline void residual_down(local float *b, local float *u, cfield_t rhs, cfield_t d, int pitch, float screening) {
    float keep[OWNED], residual[OWNED];
    int lid = get_local_id(0), n = SIDE(0);
    for (int o = 0; o < OWNED; o++) {
        int i = lid + o * BOTTOM_ITEMS;
        if (i >= n * n) continue;
        int y = row_of(i, n), at = y * pitch + i - y * n;
        keep[o] = u[i];
        residual[o] = d[at] < 0.0f ? 0.0f : fma(-(d[at] + screening), u[i], differences_at(u, n, i) + rhs[at]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int o = 0; o < OWNED; o++) {
        int i = lid + o * BOTTOM_ITEMS;
        if (i < n * n) u[i] = residual[o];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    restrict_local(b, u, n);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int o = 0; o < OWNED; o++) {
        int i = lid + o * BOTTOM_ITEMS;
        if (i < n * n) u[i] = keep[o];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

// V-cycles from zero on level 0. One work-group of BOTTOM_ITEMS per channel.
kernel __attribute__((reqd_work_group_size(BOTTOM_ITEMS, 1, 1)))
void bottom(cfield_t rhs, cfield_t d, field_t out, cfield_t matrix, constant int *tab, int stride, float screening,
            constant float *weights, int cycles) {
    local float u[BOTTOM_SAMPLES], b[BOTTOM_SAMPLES - SIDE(0) * SIDE(0)];
    int lid = get_local_id(0), pitch = tab[2], n = SIDE(0);
    rhs += (size_t)get_group_id(0) * stride;
    out += (size_t)get_group_id(0) * stride;
    for (int i = lid; i < n * n; i += BOTTOM_ITEMS) {
        int at = (i / n) * pitch + i % n;
        u[i] = d[at] < 0.0f ? rhs[at] : 0.0f;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int cycle = 0; cycle < cycles; cycle++) {
        // down: where level -k begins in u, and level -k - 1 in b
        int at = 0, under = 0;
        residual_down(b, u, rhs, d, pitch, screening);
        for (int k = 1; k < BOTTOM_LEVELS; k++) {
            int area = SIDE(k) * SIDE(k);
            restrict_local(b + under + area, b + under, SIDE(k));
            barrier(CLK_LOCAL_MEM_FENCE);
            under += area;
        }
        for (int k = 0; k < BOTTOM_LEVELS; k++) at += SIDE(k) * SIDE(k);
        for (int i = lid; i < COARSEST * COARSEST; i += BOTTOM_ITEMS) {
            float sum = 0.0f;
            for (int j = 0; j < COARSEST * COARSEST; j++) sum = fma(matrix[i * COARSEST * COARSEST + j], b[under + j], sum);
            u[at + i] = sum;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int k = BOTTOM_LEVELS - 1; k >= 0; k--) {
            int area = SIDE(k) * SIDE(k);
            if (k) under -= area;
            relax_local(u + at - area, u + at, k ? 0 : rhs, b + under, d + tab[4 * k], SIDE(k), tab[4 * k + 2],
                        ldexp(screening, 2 * k), k > 0, weights);
            at -= area;
        }
    }
    for (int i = lid; i < n * n; i += BOTTOM_ITEMS) out[(i / n) * pitch + i % n] = u[i];
}
