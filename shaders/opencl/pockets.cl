// The correction of refinement on a coarse grid, a window at a time (docs/refinement.md); after rows.cl. Twin:
// backend/esker/solve/refine/correction.py, which says what the fields mean.
//
// A coarse grid of a window holds every second of its rows and columns, the next one every second of these. Fields of a
// grid are planes `stride` floats apart: the four arms, the springs, the right-hand side, the correction,
// and the inverse of how stiffly arms hold a sample amid four others.
#pragma OPENCL FP_CONTRACT OFF

enum { EAST, WEST, NORTH, SOUTH, SPRING, RIGHT, CORRECTION, LOOSE };

typedef struct {
    int rows, columns, pitch, stride;
} grid_t;

inline crow_t plane(crow_t grid, int k, int y, grid_t g) { return crow(grid + (size_t)k * g.stride, y, g.pitch); }
inline row_t wplane(row_t grid, int k, int y, grid_t g) { return row(grid + (size_t)k * g.stride, y, g.pitch); }

// v = f - A u of a channel, zero at fixed samples; ghosts of v and of d. Global size (strips of `each` rows).
kernel void refine_residual(crow_t u, row_t v, crow_t f, row_t d, int channel, int rows, int columns, int pitch,
                            int stride, float screening, int each) {
    int first = get_global_id(0) * each;
    u += (size_t)channel * stride;
    v += (size_t)channel * stride;
    for (int y = first; y < min(rows, first + each); y++) {
        crow_t south = crow(u, mirror(y - 1, rows), pitch), here = crow(u, y, pitch),
               north = crow(u, mirror(y + 1, rows), pitch), right = crow(f, y, pitch);
        row_t out = row(v, y, pitch), stiff = row(d, y, pitch);
        for (int x = 0; x < columns; x += VW) {
            float16 c = vload16(0, here + x), k = vload16(0, stiff + x);
            float16 sum = ((vload16(0, south + x) - c) + (vload16(0, north + x) - c)) +
                          ((vload16(0, here + x - 1) - c) + (vload16(0, here + x + 1) - c));
            float16 r = fma(-(k + screening), c, sum + vload16(0, right + x));
            vstore16(select(r, (float16)(0.0f), k < 0.0f), 0, out + x);
        }
        ghosts(out, columns);
        ghosts(stiff, columns);
    }
}

// What a node's value counts for the sample midway along an arm.
inline float share(float arm) { return arm > 0.5f ? 1.0f - 0.5f / fmin(arm, 1.0f) : 0.0f; }
inline float16 share16(float16 arm) { return select((float16)(0.0f), 1.0f - 0.5f / fmin(arm, 1.0f), arm > 0.5f); }

// At the ends of a row an arm is its mirror image.
inline void mirrored_arms(row_t coarse, int y, grid_t g) {
    wplane(coarse, WEST, y, g)[0] = wplane(coarse, EAST, y, g)[0];
    wplane(coarse, EAST, y, g)[g.columns - 1] = wplane(coarse, WEST, y, g)[g.columns - 1];
    int from = y == 0 ? NORTH : SOUTH, to = y == 0 ? SOUTH : NORTH;
    if (y > 0 && y < g.rows - 1) return;
    crow_t a = plane(coarse, from, y, g);
    row_t b = wplane(coarse, to, y, g);
    for (int x = 0; x < g.columns; x++) b[x] = a[x];
}

inline float16 evens(crow_t p) { return (float16)(load16(p).even, load16(p + VW).even); }
inline float16 odds(crow_t p) { return (float16)(load16(p).odd, load16(p + VW).odd); }
inline float16 arm(float16 middle, float16 end, float16 node) {
    float16 t = select((float16)(2.0f), (float16)(1.0f), end < 0.0f);
    return select(select(t, (float16)(0.5f), middle < 0.0f), (float16)(0.0f), node < 0.0f);
}
// A row of springs at the nodes and, halved, beside them.
inline float16 springs(crow_t d) {
    return fmax(evens(d), 0.0f) + 0.5f * (fmax(odds(d), 0.0f) + fmax(evens(d - 1), 0.0f));
}

// 1 / (1 / east + 1 / west + 1 / north + 1 / south), of a row; 0 at fixed samples.
inline void loosened(row_t grid, int y, grid_t g) {
    for (int x = 0; x < g.columns; x += VW) {
        float16 east = vload16(0, plane(grid, EAST, y, g) + x), west = vload16(0, plane(grid, WEST, y, g) + x),
                north = vload16(0, plane(grid, NORTH, y, g) + x), south = vload16(0, plane(grid, SOUTH, y, g) + x);
        float16 held = (1.0f / fmin(east, 1.0f) + 1.0f / fmin(west, 1.0f)) +
                       (1.0f / fmin(north, 1.0f) + 1.0f / fmin(south, 1.0f));
        vstore16(select((float16)(0.0f), 1.0f / held, east > 0.0f), 0, wplane(grid, LOOSE, y, g) + x);
    }
}

// Arms, springs and right-hand side of the first coarse grid `coarse`, from the residual, a channel of r; samples of
// the level are fixed where d is less than zero. Ghosts of d and r are set. Global size (strips of `each` coarse rows).
kernel void pocket_first(crow_t d, crow_t r, int channel, int rows, int columns, int pitch, int stride, row_t coarse, int coarse_rows,
                         int coarse_columns, int coarse_pitch, int coarse_stride, int each) {
    grid_t g = {coarse_rows, coarse_columns, coarse_pitch, coarse_stride};
    int first = get_global_id(0) * each;
    r += (size_t)channel * stride;
    for (int Y = first; Y < min(g.rows, first + each); Y++) {
        int ys = mirror(2 * Y - 1, rows), yn = mirror(2 * Y + 1, rows);
        crow_t here = crow(d, 2 * Y, pitch), south = crow(d, ys, pitch), north = crow(d, yn, pitch);
        crow_t far_south = crow(d, mirror(2 * Y - 2, rows), pitch), far_north = crow(d, mirror(2 * Y + 2, rows), pitch);
        for (int X = 0; X < g.columns; X += VW) {
            int x = 2 * X;
            float16 node = evens(here + x);
            vstore16(arm(odds(here + x), evens(here + x + 2), node), 0, wplane(coarse, EAST, Y, g) + X);
            vstore16(arm(evens(here + x - 1), evens(here + x - 2), node), 0, wplane(coarse, WEST, Y, g) + X);
            vstore16(arm(evens(north + x), evens(far_north + x), node), 0, wplane(coarse, NORTH, Y, g) + X);
            vstore16(arm(evens(south + x), evens(far_south + x), node), 0, wplane(coarse, SOUTH, Y, g) + X);
            float16 sum = springs(here + x) + 0.5f * (springs(south + x) + springs(north + x));
            vstore16(sum / fma((float16)(SATURATION), sum, (float16)(1.0f)), 0, wplane(coarse, SPRING, Y, g) + X);
        }
        mirrored_arms(coarse, Y, g);
        loosened(coarse, Y, g);
        crow_t a = crow(r, ys, pitch), b = crow(r, 2 * Y, pitch), c = crow(r, yn, pitch);
        for (int X = 0; X < g.columns; X += VW) {
            int x = 2 * X;
            float16 se = odds(a + x), ne = odds(c + x), sw = evens(a + x - 1), nw = evens(c + x - 1);
            float16 sum = evens(b + x);
            sum = fma(share16(vload16(0, plane(coarse, EAST, Y, g) + X)), odds(b + x) + 0.25f * (ne + se), sum);
            sum = fma(share16(vload16(0, plane(coarse, WEST, Y, g) + X)), evens(b + x - 1) + 0.25f * (nw + sw), sum);
            sum = fma(share16(vload16(0, plane(coarse, NORTH, Y, g) + X)), evens(c + x) + 0.25f * (ne + nw), sum);
            sum = fma(share16(vload16(0, plane(coarse, SOUTH, Y, g) + X)), evens(a + x) + 0.25f * (se + sw), sum);
            vstore16(sum, 0, wplane(coarse, RIGHT, Y, g) + X);
        }
    }
}

inline float at(crow_t grid, int k, int y, int x, grid_t g) { return plane(grid, k, y, g)[x]; }
inline float longer(float near, float beyond) { return near <= 1.0f ? 0.5f * near : 0.5f * (1.0f + beyond); }

// What the sample amid four others gives of its right-hand side to the one at the end of an arm.
inline float given(crow_t grid, int k, int y, int x, grid_t g) {
    return at(grid, k, y, x, g) >= 1.0f ? at(grid, RIGHT, y, x, g) * at(grid, LOOSE, y, x, g) : 0.0f;
}

// Arms, springs and right-hand side of the next coarser grid. Global size (strips of `each` coarse rows).
kernel void pocket_next(crow_t fine, int fine_rows, int fine_columns, int fine_pitch, int fine_stride, row_t coarse,
                        int coarse_rows, int coarse_columns, int coarse_pitch, int coarse_stride, int each) {
    grid_t f = {fine_rows, fine_columns, fine_pitch, fine_stride};
    grid_t g = {coarse_rows, coarse_columns, coarse_pitch, coarse_stride};
    int first = get_global_id(0) * each;
    for (int Y = first; Y < min(g.rows, first + each); Y++) {
        int y = 2 * Y, ys = mirror(y - 1, f.rows), yn = mirror(y + 1, f.rows);
        for (int X = 0; X < g.columns; X++) {
            int x = 2 * X, xw = mirror(x - 1, f.columns), xe = mirror(x + 1, f.columns);
            wplane(coarse, EAST, Y, g)[X] = longer(at(fine, EAST, y, x, f), at(fine, EAST, y, xe, f));
            wplane(coarse, WEST, Y, g)[X] = longer(at(fine, WEST, y, x, f), at(fine, WEST, y, xw, f));
            wplane(coarse, NORTH, Y, g)[X] = longer(at(fine, NORTH, y, x, f), at(fine, NORTH, yn, x, f));
            wplane(coarse, SOUTH, Y, g)[X] = longer(at(fine, SOUTH, y, x, f), at(fine, SOUTH, ys, x, f));
            crow_t a = plane(fine, SPRING, ys, f), b = plane(fine, SPRING, y, f), c = plane(fine, SPRING, yn, f);
            float sum = (b[x] + 0.5f * (b[xw] + b[xe])) +
                        0.5f * ((a[x] + 0.5f * (a[xw] + a[xe])) + (c[x] + 0.5f * (c[xw] + c[xe])));
            wplane(coarse, SPRING, Y, g)[X] = sum / fma(SATURATION, sum, 1.0f);
        }
        mirrored_arms(coarse, Y, g);
        loosened(coarse, Y, g);
        // beyond a border lies the mirror image, whose arms point the other way
        int down = y == 0 ? SOUTH : NORTH, up = y + 1 < f.rows ? SOUTH : NORTH;
        for (int X = 0; X < g.columns; X++) {
            int x = 2 * X, xw = mirror(x - 1, f.columns), xe = mirror(x + 1, f.columns);
            int left = x == 0 ? WEST : EAST, right = x + 1 < f.columns ? WEST : EAST;
            float east = at(fine, RIGHT, y, xe, f) + (given(fine, up, yn, xe, f) + given(fine, down, ys, xe, f));
            float west = at(fine, RIGHT, y, xw, f) + (given(fine, up, yn, xw, f) + given(fine, down, ys, xw, f));
            float north = at(fine, RIGHT, yn, x, f) + (given(fine, right, yn, xe, f) + given(fine, left, yn, xw, f));
            float south = at(fine, RIGHT, ys, x, f) + (given(fine, right, ys, xe, f) + given(fine, left, ys, xw, f));
            float sum = at(fine, RIGHT, y, x, f);
            sum = fma(share(at(coarse, EAST, Y, X, g)), east, sum);
            sum = fma(share(at(coarse, WEST, Y, X, g)), west, sum);
            sum = fma(share(at(coarse, NORTH, Y, X, g)), north, sum);
            wplane(coarse, RIGHT, Y, g)[X] = fma(share(at(coarse, SOUTH, Y, X, g)), south, sum);
        }
    }
}

// Couplings of a node to its four neighbours and its right-hand side, each divided by what holds the node, of the last
// grid and of MARGIN nodes of nothing on every side: planes of `to`, whose row 0 is MARGIN rows south of the grid's.
// Global size (1).
kernel void pocket_couple(crow_t from, int rows, int columns, int pitch, int stride, row_t to, int to_pitch,
                          int to_stride, float screening) {
    grid_t g = {rows, columns, pitch, stride}, t = {rows + 2 * MARGIN, 0, to_pitch, to_stride};
    for (int k = 0; k < 5; k++)
        for (int y = 0; y < t.rows; y++)
            for (int x = -PAD; x < to_pitch - PAD; x++) wplane(to, k, y, t)[x] = 0.0f;
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) {
            float a[4], c[4], rest = at(from, SPRING, y, x, g) + screening, sum = 0.0f;
            for (int k = 0; k < 4; k++) {
                a[k] = at(from, k, y, x, g);
                c[k] = a[k] >= 1.0f ? 1.0f : 0.0f;
                rest += a[k] < 1.0f ? 1.0f / a[k] : 0.0f;
                sum += c[k];
            }
            float q = a[0] > 0.0f ? 1.0f / (rest + sum) : 0.0f;
            if (x == 0) c[EAST] += c[WEST], c[WEST] = 0.0f;
            if (x == columns - 1) c[WEST] += c[EAST], c[EAST] = 0.0f;
            if (y == 0) c[NORTH] += c[SOUTH], c[SOUTH] = 0.0f;
            if (y == rows - 1) c[SOUTH] += c[NORTH], c[NORTH] = 0.0f;
            for (int k = 0; k < 4; k++) wplane(to, k, y + MARGIN, t)[x] = c[k] * q;
            wplane(to, 4, y + MARGIN, t)[x] = at(from, RIGHT, y, x, g) * q;
        }
}

#define SIDE (2 * SUBDOMAIN + 1)

// Corrections of subdomains of SIDE x SIDE nodes, each relaxed by itself, VW of them at once. Their middles are every
// second node of every second row: subdomains [px0, px1) of the rows from py0 on. from: `pocket_couple`'s. to: nine planes
// of subdomains, the middle's value and those of the eight nodes around it. Global size (rows of subdomains).
kernel void pocket_relax(crow_t from, int pitch, int stride, row_t to, int to_pitch, int to_stride, int py0, int px0,
                         int px1) {
    grid_t g = {0, 0, pitch, stride}, t = {0, 0, to_pitch, to_stride};
    int py = py0 + get_global_id(0);
    float16 c[5][SIDE][SIDE], e[SIDE + 2][SIDE + 2];
    for (int px = px0; px < px1; px += VW) {
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++) {
                for (int k = 0; k < 5; k++)
                    c[k][j][i] = evens(plane(from, k, 2 * py + j - SUBDOMAIN + MARGIN, g) + 2 * px + i - SUBDOMAIN);
                float16 out = 0.0f;
                if (i == SIDE - 1) out += c[EAST][j][i];
                if (i == 0) out += c[WEST][j][i];
                if (j == SIDE - 1) out += c[NORTH][j][i];
                if (j == 0) out += c[SOUTH][j][i];
                float16 more = 1.0f / (1.0f - BEYOND * out);
                for (int k = 0; k < 5; k++) c[k][j][i] *= more;
            }
        for (int j = 0; j < SIDE + 2; j++)
            for (int i = 0; i < SIDE + 2; i++) e[j][i] = 0.0f;
        for (int turn = 0; turn < 2 * RELAXATIONS; turn++)
            for (int j = 0; j < SIDE; j++)
                for (int i = (j + turn) & 1; i < SIDE; i += 2) {
                    float16 sum = fma(c[EAST][j][i], e[j + 1][i + 2], c[4][j][i]);
                    sum = fma(c[WEST][j][i], e[j + 1][i], sum);
                    sum = fma(c[NORTH][j][i], e[j + 2][i + 1], sum);
                    sum = fma(c[SOUTH][j][i], e[j][i + 1], sum);
                    e[j + 1][i + 1] = fma((float16)(OVER_RELAXATION), sum - e[j + 1][i + 1], e[j + 1][i + 1]);
                }
        for (int k = 0; k < 9; k++)
            vstore16(e[SUBDOMAIN + k / 3][SUBDOMAIN + k % 3], 0, wplane(to, k, py, t) + px);
    }
}

// The correction of rows [y0, y1) and columns [x0, x1) of nodes: of subdomains that share one the mean. Global size (1).
kernel void pocket_blend(crow_t from, int pitch, int stride, row_t to, int to_pitch, int to_stride, int y0, int y1,
                         int x0, int x1) {
    grid_t g = {0, 0, pitch, stride}, t = {0, 0, to_pitch, to_stride};
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            int down = y / 2, left = x / 2, up = down + (y & 1), right = left + (x & 1);
            int south = y & 1 ? 6 : 3, north = y & 1 ? 0 : 3, west = x & 1 ? 2 : 1, east = x & 1 ? 0 : 1;
            float a = at(from, south + west, down, left, g) + at(from, south + east, down, right, g);
            float b = at(from, north + west, up, left, g) + at(from, north + east, up, right, g);
            wplane(to, CORRECTION, y, t)[x] = 0.25f * (a + b);
        }
}

// The correction of the next finer grid, from rows [y0, y1) of cells of the coarser one. Global size (strips of `each`).
kernel void pocket_back(row_t fine, int fine_rows, int fine_columns, int fine_pitch, int fine_stride, crow_t coarse,
                        int coarse_rows, int coarse_columns, int coarse_pitch, int coarse_stride, int y0, int y1,
                        int each) {
    grid_t f = {fine_rows, fine_columns, fine_pitch, fine_stride};
    grid_t g = {coarse_rows, coarse_columns, coarse_pitch, coarse_stride};
    int first = y0 + get_global_id(0) * each;
    for (int Y = first; Y < min(y1, first + each); Y++) {
        int y = 2 * Y, N = min(Y + 1, g.rows - 1);
        crow_t a = plane(coarse, CORRECTION, Y, g), b = plane(coarse, CORRECTION, N, g);
        for (int X = 0; X < g.columns; X++) {
            int x = 2 * X, E = min(X + 1, g.columns - 1);
            float south = fma(share(at(coarse, WEST, Y, E, g)), a[E], share(at(coarse, EAST, Y, X, g)) * a[X]);
            float north = fma(share(at(coarse, WEST, N, E, g)), b[E], share(at(coarse, EAST, N, X, g)) * b[X]);
            float west = fma(share(at(coarse, SOUTH, N, X, g)), b[X], share(at(coarse, NORTH, Y, X, g)) * a[X]);
            float east = fma(share(at(coarse, SOUTH, N, E, g)), b[E], share(at(coarse, NORTH, Y, E, g)) * a[E]);
            wplane(fine, CORRECTION, y, f)[x] = a[X];
            if (x + 1 < f.columns) wplane(fine, CORRECTION, y, f)[x + 1] = south;
            if (y + 1 >= f.rows) continue;
            wplane(fine, CORRECTION, y + 1, f)[x] = west;
            if (x + 1 >= f.columns) continue;
            float sum = (at(fine, EAST, y + 1, x + 1, f) >= 1.0f ? east : 0.0f) +
                        (at(fine, WEST, y + 1, x + 1, f) >= 1.0f ? west : 0.0f);
            sum += (at(fine, NORTH, y + 1, x + 1, f) >= 1.0f ? north : 0.0f) +
                   (at(fine, SOUTH, y + 1, x + 1, f) >= 1.0f ? south : 0.0f);
            wplane(fine, CORRECTION, y + 1, f)[x + 1] = sum * at(fine, LOOSE, y + 1, x + 1, f);
        }
    }
}

inline float16 halfway(crow_t one, crow_t other, crow_t e, crow_t f, int x, int y) {
    return fma(share16(vload16(0, other + y)), vload16(0, f + y), share16(vload16(0, one + x)) * vload16(0, e + x));
}

// u += the correction where no sample is fixed, of rows [y0, y1) of cells of the first coarse grid. Global size (strips of
// `each`).
kernel void pocket_last(row_t u, crow_t d, int channel, int rows, int columns, int pitch, int stride, row_t coarse,
                        int coarse_rows, int coarse_columns, int coarse_pitch, int coarse_stride, int y0, int y1,
                        int each) {
    grid_t g = {coarse_rows, coarse_columns, coarse_pitch, coarse_stride};
    int first = y0 + get_global_id(0) * each;
    u += (size_t)channel * stride;
    for (int Y = first; Y < min(y1, first + each); Y++) {
        int N = min(Y + 1, g.rows - 1);
        crow_t a = plane(coarse, CORRECTION, Y, g), b = plane(coarse, CORRECTION, N, g);
        crow_t east = plane(coarse, EAST, Y, g), west = plane(coarse, WEST, Y, g), north = plane(coarse, NORTH, Y, g);
        crow_t far_east = plane(coarse, EAST, N, g), far_west = plane(coarse, WEST, N, g),
               far_south = plane(coarse, SOUTH, N, g);
        for (int X = 0; X < g.columns; X += VW) {
            float16 along = halfway(east, west, a, a, X, X + 1), beyond = halfway(far_east, far_west, b, b, X, X + 1);
            float16 up = halfway(north, far_south, a, b, X, X), next = halfway(north, far_south, a, b, X + 1, X + 1);
            float16 amid = 0.25f * ((up + next) + (along + beyond)), here = vload16(0, a + X);
            for (int k = 0; k < 2 && 2 * Y + k < rows; k++) {
                row_t to = row(u, 2 * Y + k, pitch) + 2 * X;
                crow_t fixed = crow(d, 2 * Y + k, pitch) + 2 * X;
                float16 even = k ? up : here, odd = k ? amid : along, low, high;
                low.even = even.lo, low.odd = odd.lo, high.even = even.hi, high.odd = odd.hi;
                vstore16(vload16(0, to) + select(low, (float16)(0.0f), vload16(0, fixed) < 0.0f), 0, to);
                vstore16(vload16(0, to + VW) + select(high, (float16)(0.0f), vload16(0, fixed + VW) < 0.0f), 0, to + VW);
            }
        }
        for (int k = 0; k < 2 && 2 * Y + k < rows; k++) ghosts(row(u, 2 * Y + k, pitch), columns);
    }
}
