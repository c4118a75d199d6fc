// The fused level visit on a GPU (DESIGN 5.3): prolong the correction, sweep, restrict the residual, in one launch.
// Twin: reference.visit.
//
// This file is compiled several times: VISIT names the kernel, CHANNELS says how many share d; a work-group of
// TILE_WIDTH x TILE_STRIPS work-items does a tile of TILE_WIDTH x (TILE_STRIPS * TILE_ROWS) samples, of which the outer
// TILE_HALO are there for their neighbours' sake only. A work-item owns a column of TILE_ROWS samples: all that belongs to a
// sample stays in its registers, and local memory only carries the solution to the neighbours. The outermost samples see
// themselves instead of what lies beyond; the error grows inwards by one sample a sweep and never leaves the halo. Beyond
// the border of the level the tile holds mirror images, which sweep by sweep remain mirror images to the bit.
#define TILE_HEIGHT (TILE_STRIPS * TILE_ROWS)
#define TILE_AREA (TILE_WIDTH * TILE_HEIGHT)
#define TILE_HALO (CHEBYSHEV_SWEEPS + 2)
#define INNER_WIDTH (TILE_WIDTH - 2 * TILE_HALO)
#define INNER_HEIGHT (TILE_HEIGHT - 2 * TILE_HALO)

// guess, correction, coarse may be null. rhs, d, out: this level; correction, coarse: the next coarser one.
kernel __attribute__((reqd_work_group_size(TILE_WIDTH, TILE_STRIPS, 1)))
void VISIT(cfield_t guess, cfield_t correction, cfield_t rhs, cfield_t d, field_t out, field_t coarse, int n, int pitch,
           int stride, int pitch2, int stride2, float screening, constant float *weights) {
    local float tile[CHANNELS * TILE_AREA];
    const int lx = get_local_id(0), ly = get_local_id(1) * TILE_ROWS;
    const int x0 = get_group_id(0) * INNER_WIDTH, y0 = get_group_id(1) * INNER_HEIGHT;
    const int gx = x0 - TILE_HALO + lx, gy = y0 - TILE_HALO + ly;
    const int west = max(lx - 1, 0), east = min(lx + 1, TILE_WIDTH - 1);
    const int south = max(ly - 1, 0) * TILE_WIDTH + lx, north = min(ly + TILE_ROWS, TILE_HEIGHT - 1) * TILE_WIDTH + lx;
    float u[CHANNELS][TILE_ROWS], f[CHANNELS][TILE_ROWS], t[TILE_ROWS], q[TILE_ROWS];
    const int mx = mirrored(gx, n);
    #pragma unroll
    for (int r = 0; r < TILE_ROWS; r++) {
        int my = mirrored(gy + r, n);
        size_t at = (size_t)my * pitch + mx;
        float dv = d[at];
        t[r] = dv + screening;
        q[r] = inverse_diagonal(dv, screening);
        #pragma unroll
        for (int c = 0; c < CHANNELS; c++) {
            f[c][r] = rhs[at + (size_t)c * stride];
            float v = guess ? guess[at + (size_t)c * stride] : (dv < 0.0f ? f[c][r] : 0.0f);
            if (correction && dv >= 0.0f) v += prolonged(correction + (size_t)c * stride2, my, mx, pitch2);
            u[c][r] = v;
            tile[c * TILE_AREA + (ly + r) * TILE_WIDTH + lx] = v;
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    // the last round computes the residual, and only where somebody wants it
    for (int k = 0; k < CHEBYSHEV_SWEEPS + (coarse ? 1 : 0); k++) {
        const int sweeping = k < CHEBYSHEV_SWEEPS;
        const float w = sweeping ? weights[k] : 0.0f;
        #pragma unroll
        for (int c = 0; c < CHANNELS; c++) {
            local const float *v = tile + c * TILE_AREA;
            float before = v[south], after = v[north];
            #pragma unroll
            for (int r = 0; r < TILE_ROWS; r++) {
                float here = u[c][r], next = r + 1 < TILE_ROWS ? u[c][r + 1] : after;
                int row = (ly + r) * TILE_WIDTH;
                float s = sum_of_differences(before, next, v[row + west], v[row + east], here) + f[c][r];
                float residual = fma(-t[r], here, s);
                u[c][r] = sweeping ? fma(w * q[r], residual, here) : (q[r] > 0.0f ? residual : 0.0f);
                before = here;
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        #pragma unroll
        for (int c = 0; c < CHANNELS; c++) {
            #pragma unroll
            for (int r = 0; r < TILE_ROWS; r++) {
                tile[c * TILE_AREA + (ly + r) * TILE_WIDTH + lx] = u[c][r];
                if (k == CHEBYSHEV_SWEEPS - 1 && lx >= TILE_HALO && lx < TILE_WIDTH - TILE_HALO && ly + r >= TILE_HALO &&
                    ly + r < TILE_HEIGHT - TILE_HALO && gx < n && gy + r < n)
                    out[(size_t)c * stride + (size_t)(gy + r) * pitch + gx] = u[c][r];
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (!coarse) return;
    const int nc = n / 2 + 1, first = get_local_id(1) * TILE_WIDTH + lx;
    for (int i = first; i < CHANNELS * (INNER_WIDTH / 2) * (INNER_HEIGHT / 2); i += TILE_WIDTH * TILE_STRIPS) {
        int c = i / ((INNER_WIDTH / 2) * (INNER_HEIGHT / 2)), j = i % ((INNER_WIDTH / 2) * (INNER_HEIGHT / 2));
        int cy = j / (INNER_WIDTH / 2), cx = j % (INNER_WIDTH / 2), Y = y0 / 2 + cy, X = x0 / 2 + cx;
        if (Y >= nc || X >= nc) continue;
        local const float *v = tile + c * TILE_AREA + (TILE_HALO + 2 * cy) * TILE_WIDTH + TILE_HALO + 2 * cx;
        float sides = (v[-TILE_WIDTH] + v[TILE_WIDTH]) + (v[-1] + v[1]);
        float corners = (v[-TILE_WIDTH - 1] + v[TILE_WIDTH + 1]) + (v[-TILE_WIDTH + 1] + v[TILE_WIDTH - 1]);
        coarse[(size_t)c * stride2 + (size_t)Y * pitch2 + X] = restricted(v[0], sides, corners);
    }
}

#undef TILE_HEIGHT
#undef TILE_AREA
#undef TILE_HALO
#undef INNER_WIDTH
#undef INNER_HEIGHT
