// The fused level visit on a GPU for levels that fill it: the work-group marches north over a strip of columns, one row a
// step, with all sweeps in flight behind each other. Twins: gpu/visit.cl (to the bit) and reference.visit.
//
// This file is compiled several times: MARCH names the kernel, MARCH_CHANNELS says how many share d, MARCH_WIDTH work-items own a
// column each. At step j the row j of the guess comes in, sweep k makes row j-1-k of its result, and the residual of row
// j-1-CHEBYSHEV_SWEEPS follows. A work-item keeps two rows of each sweep in its registers; local memory carries the rows
// that the next step looks at to the columns beside. Where a tile does a third of its work for its neighbours, a strip does
// a tenth. The rows before a strip and the columns beside it are there for their neighbours' sake: what is wrong at the rim
// grows inwards by one sample a sweep and never leaves the halo.
#define MARCH_HALO (CHEBYSHEV_SWEEPS + 2)
#define MARCH_INNER (MARCH_WIDTH - 2 * MARCH_HALO)
#define STAGES (CHEBYSHEV_SWEEPS + 1)

// guess, correction, coarse may be null. rhs, d, out: this level; correction, coarse: the next coarser one. rows: of a
// strip, an even number.
kernel __attribute__((reqd_work_group_size(MARCH_WIDTH, 1, 1)))
void MARCH(cfield_t guess, cfield_t correction, cfield_t rhs, cfield_t d, field_t out, field_t coarse, int n, int pitch,
           int stride, int pitch2, int stride2, float screening, constant float *weights, int rows) {
    local float lines[2][MARCH_CHANNELS][STAGES + 1][MARCH_WIDTH];
    const int lx = get_local_id(0), gx = (int)get_group_id(0) * MARCH_INNER - MARCH_HALO + lx, mx = mirrored(gx, n);
    const int y0 = (int)get_group_id(1) * rows, y1 = min(y0 + rows, n);
    const int west = max(lx - 1, 0), east = min(lx + 1, MARCH_WIDTH - 1);
    const bool inner = lx >= MARCH_HALO && lx < MARCH_WIDTH - MARCH_HALO && gx < n;
    float weight[STAGES], t[STAGES], q[STAGES];
    float south[MARCH_CHANNELS][STAGES], here[MARCH_CHANNELS][STAGES], f[MARCH_CHANNELS][STAGES];
    float after[MARCH_CHANNELS], middle[MARCH_CHANNELS], before[MARCH_CHANNELS];  // the residual of three rows, the newest first
    float west1[MARCH_CHANNELS], west2[MARCH_CHANNELS], east1[MARCH_CHANNELS], east2[MARCH_CHANNELS];  // and beside the last two of them
    float guessed[MARCH_CHANNELS], given[MARCH_CHANNELS], coarser[MARCH_CHANNELS][4], stiff;     // a row under way
    #pragma unroll
    for (int k = 0; k < STAGES; k++) {
        weight[k] = k < CHEBYSHEV_SWEEPS ? weights[k] : 0.0f;
        t[k] = q[k] = 0.0f;
    }
    #pragma unroll
    for (int c = 0; c < MARCH_CHANNELS; c++) {
        after[c] = middle[c] = before[c] = west1[c] = west2[c] = east1[c] = east2[c] = guessed[c] = 0.0f;
        coarser[c][0] = coarser[c][1] = coarser[c][2] = coarser[c][3] = 0.0f;
        #pragma unroll
        for (int k = 0; k < STAGES; k++) south[c][k] = here[c][k] = f[c][k] = 0.0f;
        #pragma unroll
        for (int k = 0; k <= STAGES; k++) lines[0][c][k][lx] = 0.0f;
    }
    const int begin = y0 - MARCH_HALO, end = y1 + CHEBYSHEV_SWEEPS + (coarse ? 3 : 0);
    // A row before the first: nothing but its successor's loads comes of it.
    stiff = -1.0f;
    for (int c = 0; c < MARCH_CHANNELS; c++) given[c] = 0.0f;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int begun = begin - 1; begun < end; begun += 2) {
        #pragma unroll
        for (int turn = 0; turn < 2; turn++) {  // which half of the local memory is read is known to the compiler
            const int j = begun + turn;
            float next[MARCH_CHANNELS], nextf[MARCH_CHANNELS];
            const float nextt = stiff + screening, nextq = inverse_diagonal(stiff, screening);
            #pragma unroll
            for (int c = 0; c < MARCH_CHANNELS; c++) {
                float v = guess ? guessed[c] : (stiff < 0.0f ? given[c] : 0.0f);
                if (correction && stiff >= 0.0f)
                    v += 0.25f * ((coarser[c][0] + coarser[c][1]) + (coarser[c][2] + coarser[c][3]));
                next[c] = v;
                nextf[c] = given[c];
            }
            // The next row sets out while this one is worked on.
            const int my = mirrored(j + 1, n);
            const size_t at = (size_t)my * pitch + mx;
            stiff = d[at];
            #pragma unroll
            for (int c = 0; c < MARCH_CHANNELS; c++) {
                given[c] = rhs[at + (size_t)c * stride];
                if (guess) guessed[c] = guess[at + (size_t)c * stride];
                if (correction) {
                    cfield_t a = correction + (size_t)c * stride2 + (size_t)(my / 2) * pitch2 + mx / 2;
                    cfield_t b = correction + (size_t)c * stride2 + (size_t)((my + 1) / 2) * pitch2 + mx / 2;
                    coarser[c][0] = a[0];
                    coarser[c][1] = a[mx & 1];
                    coarser[c][2] = b[0];
                    coarser[c][3] = b[mx & 1];
                }
            }
            const int centre = j - CHEBYSHEV_SWEEPS - 3, swept = j - CHEBYSHEV_SWEEPS;
            #pragma unroll
            for (int c = 0; c < MARCH_CHANNELS; c++) {
                if (coarse) {
                    // The residual of row centre + 1 has come, with its neighbours: the one before it can be restricted.
                    local const float *row = lines[turn][c][STAGES];
                    const float w = row[west], e = row[east];
                    if (inner && (gx & 1) == 0 && (centre & 1) == 0 && centre >= y0 && centre < y1) {
                        float sides = (before[c] + after[c]) + (west1[c] + east1[c]);
                        float corners = (west2[c] + e) + (east2[c] + w);
                        coarse[(size_t)c * stride2 + (size_t)(centre / 2) * pitch2 + gx / 2] =
                            restricted(middle[c], sides, corners);
                    }
                    west2[c] = west1[c];
                    east2[c] = east1[c];
                    west1[c] = w;
                    east1[c] = e;
                    before[c] = middle[c];
                    middle[c] = after[c];
                }
                float north = next[c];
                #pragma unroll
                for (int k = 0; k < STAGES; k++) {
                    if (k == CHEBYSHEV_SWEEPS && !coarse) break;
                    local const float *row = lines[turn][c][k];
                    const float s = sum_of_differences(south[c][k], north, row[west], row[east], here[c][k]) + f[c][k];
                    const float residual = fma(-t[k], here[c][k], s);
                    const float made = k < CHEBYSHEV_SWEEPS ? fma(weight[k] * q[k], residual, here[c][k])
                                                            : (q[k] > 0.0f ? residual : 0.0f);
                    south[c][k] = here[c][k];
                    here[c][k] = north;
                    north = made;
                    lines[1 - turn][c][k][lx] = here[c][k];
                    if (k == CHEBYSHEV_SWEEPS - 1 && inner && swept >= y0 && swept < y1)
                        out[(size_t)c * stride + (size_t)swept * pitch + gx] = north;
                }
                if (coarse) lines[1 - turn][c][STAGES][lx] = after[c] = north;
                #pragma unroll
                for (int k = STAGES - 1; k > 0; k--) f[c][k] = f[c][k - 1];
                f[c][0] = nextf[c];
            }
            #pragma unroll
            for (int k = STAGES - 1; k > 0; k--) {
                t[k] = t[k - 1];
                q[k] = q[k - 1];
            }
            t[0] = nextt;
            q[0] = nextq;
            barrier(CLK_LOCAL_MEM_FENCE);
        }
    }
}

#undef MARCH_HALO
#undef MARCH_INNER
#undef STAGES
