// What strokes want of samples: nearest crest points, cross-sections, their commutative sums (DESIGN 5.2, 5.4). Twin:
// backend/esker/solve/reference_section.py; tables, fields (P_..., I_...) and constants: backend/esker/solve/tables.py.
//
// Written once for two kinds of kernel. Row-wise ones (CPUs) compile it as it stands: REAL is a float16, 16 samples of
// a row. Those with one work-item a sample (GPUs) define SECTION_SCALAR before it: REAL is a float. A MASK is the
// result of a comparison: 0 / -1 in a vector, 0 / 1 in a scalar, so use the macros to make, join and test masks.
//
// With OVER_BASE defined, crest heights are those above a base that differs from sample to sample (docs/solver.md, "Over a
// base"). It is a program of its own: where there is no base, nothing of this is compiled.
#ifdef SECTION_SCALAR
#define REAL float
#define MASK int
#define ANY(mask) ((mask) != 0)
#define MASK_OF(truth) ((truth) ? 1 : 0)
#define FIRST(v) (v)
#define LAST(v) (v)
#else
#define REAL float16
#define MASK int16
#define ANY(mask) any(mask)
#define MASK_OF(truth) ((int16)((truth) ? -1 : 0))
#define FIRST(v) (v).s0
#define LAST(v) (v).sf
#endif
#define INLINE inline __attribute__((always_inline))
#define TINY 1e-20f
#define SLIGHT 1e-10f  // weight of a skirt beside a band's

// The tables as a kernel's first arguments, and as it hands them on.
#define TABLE_ARGUMENTS                                                                                          \
    global const float *segments, int segment_count, global const float *knots, int knot_count,                 \
        global const float4 *pieces, global const int *octaves, global const float *strokes,                   \
        global const int *index, global const int *row_start, global const int *row_items,                      \
        global const int *span_index, global const float *spans, int row0, int column0, float spacing, float octave, \
        float exit_length, float cliff
#define TABLES                                                                                              \
    {{segment_count, segments}, {knot_count, knots, pieces, octaves}, strokes, index, row_start, row_items, \
     span_index, spans, row0, column0, spacing, octave, 1.0f / exit_length, cliff}

typedef struct {
    int m;                      // segments in all
    global const float *table;  // SEGMENT_FIELDS x m
} segments_t;

typedef struct {
    int m;                        // knots in all
    global const float *knots;    // KNOT_FIELDS x m
    global const float4 *pieces;  // crest heights smoothed, octave by octave: cubics
    global const int *octaves;    // per stroke and octave: where piece 0 is
} profiles_t;

typedef struct {
    segments_t outlines;
    profiles_t profiles;
    global const float *strokes;                                // STROKE_STRIDE floats a stroke
    global const int *index, *row_start, *row_items;            // INDEX_STRIDE, and by row of bins: ITEM_STRIDE ints
    global const int *span_index;
    global const float *spans;
    int row0, column0;   // first bin of the tables
    float s, octave;     // metres a cell; metres between the controls of the first octave
    float decay, cliff;  // 1 / exit length; 1 / reach, or 0 for endless
#ifdef OVER_BASE
#ifdef SECTION_SCALAR
    float over;  // the base at this work-item's sample
#else
    global const float *over;  // the base at the bin's first sample, rows `pitch` apart
    int pitch;
#endif
#endif
} tables_t;

#ifdef OVER_BASE
#ifdef SECTION_SCALAR
#define LOWER(near, t, y) (near).height -= (t)->over
#else
#define LOWER(near, t, y) (near).height -= vload16(0, (t)->over + (size_t)(y) * (t)->pitch)
#endif
#else
#define LOWER(near, t, y)
#endif

typedef struct {
    REAL distance, height, rate, rx, ry, along_x, along_y, left;
} nearest_t;

typedef struct {
    REAL w, wt, wtt, wa, fade, held, g, gx, gy, toe, hard;
#ifdef OVER_BASE
    REAL share;
#endif
} sums_t;

INLINE REAL smooth(REAL t) {
    t = clamp(t, 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

// --- outlines: level crests, curved in plan ---

// Is segment `at` nearer to the samples of a row than what they have?
INLINE void consider(REAL *best2, MASK *best, segments_t s, int at, REAL x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[2 * m], dy = t[3 * m], py = y - t[m];
    REAL px = x - t[0], u = clamp((px * dx + py * dy) * t[4 * m], 0.0f, 1.0f);
    REAL rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    MASK better = d2 < *best2;
    *best2 = select(*best2, d2, better);
    *best = select(*best, (MASK)(at), better);
}

// What the samples whose nearest segment is `at` need to know of their nearest crest point.
INLINE void resolve(nearest_t *out, MASK mine, segments_t s, int at, REAL x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[2 * m], dy = t[3 * m], py = y - t[m];
    REAL px = x - t[0], u = clamp((px * dx + py * dy) * t[4 * m], 0.0f, 1.0f);
    REAL rx = px - u * dx, ry = py - u * dy, distance = sqrt(rx * rx + ry * ry);
    MASK at0 = u <= 0.0f, at1 = u >= 1.0f;
    REAL tx = select(select((REAL)(dx), (REAL)(t[7 * m]), at1), (REAL)(t[5 * m]), at0);
    REAL ty = select(select((REAL)(dy), (REAL)(t[8 * m]), at1), (REAL)(t[6 * m]), at0);
    REAL cross = tx * ry - ty * rx;
    MASK cap = (at0 && MASK_OF(t[9 * m] > 0.0f)) || (at1 && MASK_OF(t[10 * m] > 0.0f));
    REAL side = select(select((REAL)(0.5f), (REAL)(0.0f), cross < 0.0f), (REAL)(1.0f), cross > 0.0f);
    if (ANY(cap)) side = select(side, 0.5f + 0.5f * cross / fmax(distance, 1e-6f), cap);
    out->distance = select(out->distance, distance, mine);
    out->rx = select(out->rx, rx, mine);
    out->ry = select(out->ry, ry, mine);
    out->left = select(out->left, side, mine);
}

INLINE MASK inside_row(global const float *spans, int from, int to, REAL x) {
    MASK in = 0;
    for (int i = from; i < to; i++) in = in || (x >= spans[2 * i] && x <= spans[2 * i + 1]);
    return in;
}

// --- profiles: straight in plan, of varying height ---

// Height of a crest and its slope per cell at q, by its knots. first, last: least and greatest q.
INLINE void knots_at(REAL *z, REAL *slope, profiles_t t, int start, int count, REAL q, float first, float last,
                     float steepest) {
    global const float *at = t.knots + start, *height = at + t.m, *fall = at + 2 * (size_t)t.m;
    int j = 0;
    for (int step = count / 2, left = count; left > 1; left -= step, step = left / 2)
        if (at[j + step] <= first) j += step;
    *z = height[j] + fall[j] * (q - at[j]);
    *slope = fall[j];
    for (j++; j < count && at[j] <= last; j++) {
        MASK mine = q >= at[j];
        *z = select(*z, height[j] + fall[j] * (q - at[j]), mine);
        *slope = select(*slope, (REAL)(fall[j]), mine);
    }
    *slope = clamp(*slope, -steepest, steepest);
}

// The same of a smoothed crest: a cubic per piece, `inverse` pieces a cell.
INLINE void spline_at(REAL *z, REAL *slope, global const float4 *pieces, REAL q, float first, float last,
                      float inverse) {
    REAL u = q * inverse;
    int k = (int)floor(first * inverse), end = (int)floor(last * inverse);
    float4 a = pieces[k];
    REAL f = u - (float)k;
    *z = a.x + f * (a.y + f * (a.z + f * a.w));
    *slope = a.y + f * (2.0f * a.z + f * (3.0f * a.w));
    while (++k <= end) {
        a = pieces[k];
        f = u - (float)k;
        MASK mine = f >= 0.0f;
        *z = select(*z, a.x + f * (a.y + f * (a.z + f * a.w)), mine);
        *slope = select(*slope, a.y + f * (2.0f * a.z + f * (3.0f * a.w)), mine);
    }
    *slope *= inverse;
}

// The same in octave o: 0 is the crest itself, each further one is twice as smooth as the last.
INLINE void octave_at(REAL *z, REAL *slope, const tables_t *t, global const int *at, int o, REAL q, float first,
                      float last) {
    if (o == 0) {
        knots_at(z, slope, t->profiles, at[I_FIRST], at[I_COUNT], q, first, last, STEEPEST * t->s);
        return;
    }
    global const float4 *pieces = t->profiles.pieces + t->profiles.octaves[at[I_OCTAVE] + o - 1];
    spline_at(z, slope, pieces, q, first, last, t->s / (t->octave * (1 << (o - 1))));
}

// Height of a crest at q for samples d metres beyond its plateau, its slope per cell and its change per metre of d: the
// farther a sample, the smoother the crest that it sees (reference_section.crest_at).
// q is between first and last, d between near and far.
INLINE void crest_at(REAL *z, REAL *slope, REAL *rate, const tables_t *t, global const int *at, REAL q, float first,
                     float last, REAL d, float near, float far) {
    float unit = FAN * t->octave;
    int count = at[I_OCTAVES], o = 0;
    while (o < count && unit * ((2 << o) - 1) <= near) o++;
    octave_at(z, slope, t, at, o, q, first, last);
    *rate = 0.0f;
    for (; o < count && unit * ((1 << o) - 1) < far; o++) {
        float from = unit * ((1 << o) - 1), inverse = 1.0f / (unit * (1 << o));
        REAL v = clamp((d - from) * inverse, 0.0f, 1.0f), share = v * v * (3.0f - 2.0f * v), smoother, along;
        octave_at(&smoother, &along, t, at, o + 1, q, first, last);
        *rate = *rate * (1.0f - share) + 6.0f * inverse * v * (1.0f - v) * (smoother - *z);
        MASK all = v >= 1.0f;  // to the bit: what a sample gets does not depend on where its neighbours begin
        *z = select(*z + share * (smoother - *z), smoother, all);
        *slope = select(*slope + share * (along - *slope), along, all);
    }
}

// Least magnitude between two values on a straight line.
INLINE float nearest_zero(float a, float b) {
    return a * b <= 0.0f ? 0.0f : fmin(fabs(a), fabs(b));
}

INLINE float hypotenuse(float a, float b) {
    return sqrt(a * a + b * b);
}

// The nearest crest point of a profile; false when no sample is within its reach. Products are differences of such with
// the rounding of one made good, so that a crest of 100,000 cells has no grain.
INLINE int straight(nearest_t *out, const tables_t *t, global const float *p, global const int *at, REAL x, float y) {
    float tx = p[P_TX], ty = p[P_TY], py = y - p[P_AY], b = py * ty, c = py * tx;
    REAL px = x - p[P_AX], zero = 0.0f, slope;
    REAL along = fma(px, (REAL)(tx), (REAL)(b)) + fma(py, ty, -b);
    REAL cross = fma(py, tx, -c) - fma(px, (REAL)(ty), (REAL)(-c));
    REAL q = clamp(along, 0.0f, p[P_LENGTH]), past = along - q;
    float least = hypotenuse(nearest_zero(FIRST(past), LAST(past)), nearest_zero(FIRST(cross), LAST(cross)));
    if (least > p[P_REACH]) return 0;
    REAL distance = sqrt(past * past + cross * cross), d = clamp(distance, p[P_PLATEAU], p[P_REACH]) - p[P_PLATEAU];
    float q0 = FIRST(q), q1 = LAST(q), near = fmax(least - p[P_PLATEAU], 0.0f), far = fmax(FIRST(d), LAST(d));
    crest_at(&out->height, &slope, &out->rate, t, at, q, fmin(q0, q1), fmax(q0, q1), d * t->s, near * t->s, far * t->s);
    MASK cap = past != 0.0f;
    slope = select(slope, zero, cap);
    out->distance = distance;
    out->rx = past * tx - cross * ty;
    out->ry = past * ty + cross * tx;
    out->along_x = slope * tx;
    out->along_y = slope * ty;
    out->left = select(select((REAL)(0.5f), zero, cross < 0.0f), (REAL)(1.0f), cross > 0.0f);
    if (ANY(cap)) out->left = select(out->left, 0.5f + 0.5f * cross / fmax(distance, 1e-6f), cap);
    return 1;
}

// --- cross-sections ---

// A stroke's band where samples are: its flank there, and how far it goes.
typedef struct {
    REAL d, ds, present, slope, run, extent, k, f, top, full, end;
    MASK hard, has, within;
} band_t;

INLINE band_t band_of(const nearest_t *near, MASK inside, global const float *p, float s) {
    band_t b;
    REAL zero = 0.0f, one = 1.0f;
    b.d = fmax(select(near->distance, zero, inside) - p[P_PLATEAU], 0.0f);
    b.ds = b.d * s;
    b.hard = b.d < CREST_HALF_WIDTH;
    b.within = inside || near->distance <= p[P_REACH];
    b.top = fabs(near->height);
    if (p[P_SAME] > 0.0f) {
        b.present = p[P_RH];
        b.has = MASK_OF(p[P_RH] > 0.0f);
        b.slope = p[P_RS];
        b.run = p[P_RUN];
        b.extent = p[P_RE];
        b.k = p[P_RK];
        b.f = p[P_RF];
    } else {
        REAL left = near->left * p[P_LH];
        b.present = left + (1.0f - near->left) * p[P_RH];
        b.has = b.present > 0.0f;
        REAL share = left / fmax(b.present, TINY);
        b.slope = select(one, p[P_RS] + share * (p[P_LS] - p[P_RS]), b.has);
        b.run = 1.0f / b.slope;
        b.extent = p[P_RE] + share * (p[P_LE] - p[P_RE]);
        b.k = p[P_RK] + share * (p[P_LK] - p[P_RK]);
        b.f = p[P_RF] + share * (p[P_LF] - p[P_RF]);
    }
#ifdef OVER_BASE
    b.present *= select((REAL)(p[P_FILL]), (REAL)(p[P_CUT]), near->height < 0.0f);
#endif
    b.full = (1.0f + b.k + b.f) * b.top * b.run;
    b.end = select(zero, fmin(b.extent, b.full), b.has);
    return b;
}

// Height, fall per metre and change with the crest height of a flank d metres from the crest, at most its full width
// (reference_section.flank_profile).
INLINE void flank_profile(const band_t *b, REAL d, REAL *z, REAL *fall, REAL *lift) {
    REAL half_square = 0.5f * b->slope * b->slope, rest = b->full - d, top = b->top, k = b->k, f = b->f;
    MASK shoulder = d < 2.0f * k * top * b->run, foot = rest < 2.0f * f * top * b->run;
    *z = (1.0f + k) * top - b->slope * d;
    *fall = b->slope;
    *lift = 1.0f + k;
    if (ANY(shoulder)) {
        REAL over = 1.0f / fmax(k * top, TINY), curve = half_square * over, drop = 0.5f * curve * d;
        *z = select(*z, top - drop * d, shoulder);
        *fall = select(*fall, curve * d, shoulder);
        *lift = select(*lift, 1.0f + drop * d * k * over, shoulder);
    }
    if (ANY(foot)) {
        REAL over = 1.0f / fmax(f * top, TINY), curve = half_square * over, low = 0.5f * curve * rest * rest;
        *z = select(*z, low, foot);
        *fall = select(*fall, curve * rest, foot);
        *lift = select(*lift, curve * rest * (1.0f + k + f) * b->run - low * f * over, foot);
    }
}

// Where a band's extent cuts it so high that the ground would break off: width of the skirt that leads down from there,
// metres, and how much it is called for, 0..1 (reference_section.skirt).
INLINE REAL skirt(const band_t *b, float cliff, REAL *width, REAL *height, REAL *lift) {
    REAL fall;
    flank_profile(b, b->end, height, &fall, lift);
    REAL zero = 0.0f, need = select(zero, smooth(*height * cliff * (1.0f / SKIRT_SLOPE) - 0.5f), b->has);
    *width = need * 2.0f * *height / fmax(fall, SKIRT_SLOPE);
    return need;
}

// Weight of a stroke beside others by the distance from its crest (reference_section.nearness).
INLINE REAL nearness(const band_t *b, const tables_t *t) {
    REAL q = b->ds / fmax(NEAR_SHARE * b->end, NEAR_FLOOR * fmax(t->s, t->octave));
    return 1.0f / (1.0f + q * q);
}

// Adds one stroke's cross-section to the sums (reference_section.cross_section). p: STROKE_FIELDS.
INLINE void cross_section(sums_t *sum, const nearest_t *near, MASK inside, global const float *p, const tables_t *t) {
    band_t b = band_of(near, inside, p, t->s);
    REAL zero = 0.0f, one = 1.0f, inverse = 1.0f / fmax(b.end, THINNEST_M);
    REAL r = fmin(b.ds * inverse, 1e6f), wide = fmin(inverse, 1.0f / (SPRING_FLOOR_CELLS * t->s)), rt = b.ds * wide;
    REAL toe_end = TOE, need = 0.0f, width = 0.0f, foot_height = 0.0f, foot_lift = 0.0f;
    MASK cut = b.has && b.end < b.full;
    if (t->cliff > 0.0f && ANY(cut)) {
        need = skirt(&b, t->cliff, &width, &foot_height, &foot_lift);
        toe_end = fmax(toe_end, 1.0f + width * wide);
    }
    MASK reached = b.within && (b.hard || (b.has && rt < toe_end));
    if (!ANY(reached)) return;
    REAL z, fall, lift, free = 0.0f, skirted = 0.0f;
#ifdef OVER_BASE
    REAL left_off = 0.0f;
#endif
    flank_profile(&b, fmin(b.ds, b.end), &z, &fall, &lift);
    MASK beyond = r > 1.0f;
    REAL held = 1.0f;
    if (ANY(r > SPRING_FULL_FRACTION)) {
        free = smooth((r - SPRING_FULL_FRACTION) * (1.0f / (1.0f - SPRING_FULL_FRACTION)));
        REAL over = fmax(b.ds - b.end, 0.0f), past = 1.0f + over * t->decay;
        REAL level = fmin(8.0f * (1.0f - b.end / fmax(b.full, TINY)), 1.0f), rest = fmax(1.0f - over / fmax(width, TINY), 0.0f);
        REAL leaving = select(free * level * (1.0f - need), one, beyond);
        REAL exit = fmin(fall, EXIT_SHARE * t->decay * z) / (past * past);
        REAL down = 2.0f * foot_height * rest / fmax(width, TINY);
        fall += leaving * (exit + need * (down - exit) - fall);
#ifdef OVER_BASE
        left_off = select(leaving, zero, beyond);
#endif
        z += select(zero, need * (foot_height * rest * rest - z), beyond);
        lift = select(lift, need * foot_lift * rest * rest, beyond);
        REAL ends = b.ds / fmax(b.end + width, THINNEST_M);
        held = 1.0f - smooth((ends - HELD_FRACTION) * (1.0f / (1.0f - HELD_FRACTION)));
        skirted = select(zero, SLIGHT * held, beyond);
    }
    lift = select(one, lift, b.has);
    REAL sign = select(one, -one, near->height < 0.0f);
    REAL down = select(zero, lift * near->rate - sign * fall, b.has && near->distance > p[P_PLATEAU] && !inside);
    REAL near_weight = nearness(&b, t), inner = fmax(1.0f - r, 0.0f), outer = fmax(1.0f - rt / toe_end, 0.0f);
    REAL fade = select(zero, select(b.present * (1.0f - free), one, b.hard), reached);
    REAL toe = select(zero, b.present * (1.0f - smooth((rt - 1.0f) / (toe_end - 1.0f))), reached && b.has);
    REAL w = near_weight * (fade * select(inner * inner + TINY, one, b.hard) + select(zero, skirted, reached));
    REAL g = near_weight * toe * outer * outer, a = SPRING_CELLS * t->s * wide;
    REAL unit = down / fmax(near->distance, 0.5f);
#ifdef OVER_BASE
    sum->share += g * lift * (1.0f - left_off);
#endif
    lift = select(lift * (1.0f / t->s), zero, inside);
    sum->w += w;
    sum->wt += w * sign * z;
    sum->wtt += w * z * z;
    sum->wa += w * a * a;
    sum->fade = fmax(sum->fade, fade);
    sum->held = fmax(sum->held, select(zero, select(b.present * held, one, b.hard), reached));
    sum->g += g;
    sum->gx += g * (unit * near->rx + lift * near->along_x);
    sum->gy += g * (unit * near->ry + lift * near->along_y);
    sum->toe = fmax(sum->toe, toe);
    sum->hard = select(sum->hard, one, b.hard && reached);
}

// Adds what one stroke, a crest or a brush, says of a channel to gx (weights in g, knowledge in toe) (DESIGN 5.4).
INLINE void channel_section(sums_t *sum, const nearest_t *near, MASK inside, global const float *p, const tables_t *t) {
    if (p[P_BRUSH] > 0.0f) {
        REAL painted = 1.0f - smooth(near->distance * (1.0f / p[P_BRUSH]));
        sum->g += painted;
        sum->gx += painted * p[P_VALUE];
        sum->toe = fmax(sum->toe, painted);
        return;
    }
    band_t b = band_of(near, inside, p, t->s);
    REAL zero = 0.0f, one = 1.0f, r = b.ds / fmax(b.end, CHANNEL_FLOOR_CELLS * t->s);
    REAL known = select(b.present * (1.0f - smooth((r - 1.0f) * (1.0f / (TOE - 1.0f)))), one, b.hard);
    known = select(zero, known, b.within);
    REAL outer = fmax(1.0f - r * (1.0f / TOE), 0.0f);
    REAL g = known * nearness(&b, t) * select(outer * outer, one, b.hard);
    sum->g += g;
    sum->gx += g * p[P_VALUE];
    sum->toe = fmax(sum->toe, known);
}

// What all strokes together say of samples: D and f of both equations, stiffness -1 where fixed.
typedef struct {
    REAL height_d, height_f, gradient_d, gradient_fx, gradient_fy;
#ifdef OVER_BASE
    REAL share;   // how far the gradient is that of the ground itself, not of what lies above the base
    REAL target;  // what strokes want above the base, 0 where they want nothing
#endif
} constraint_t;

// D and f of a channel, and f of its cover, which is 1 where the channel is known: there screening pulls to what is asked.
INLINE void conclude_channel(REAL *d, REAL *f, REAL *cover, const sums_t *sum, float screening) {
    *d = CREST_STIFFNESS * sum->toe;
    *cover = *d + screening * sum->toe;
    *f = *cover * sum->gx / fmax(sum->g, TINY);
}

// x: columns of the samples, y their row, n samples a side; a pinned border is fixed at the base. s, octave: see tables_t.
INLINE constraint_t conclude(const sums_t *sum, MASK x, int y, int n, float screening, int pinned, float s, float octave) {
    constraint_t out;
    REAL zero = 0.0f, fixed = -1.0f;
    REAL w = fmax(sum->w, TINY), target = sum->wt / w;
    REAL square = sum->wtt / w, apart = fmax(square * (1.0f - AGREEMENT_NOISE) - target * target, 0.0f);
    REAL quarrel = apart / (apart + AGREEMENT * square + TINY);
    REAL a = sum->wa / w;
    a = (a + fmin(OVERLAP_STIFFENING * a, OVERLAP_STIFFEST) * quarrel * quarrel) * sum->fade;
    MASK hard = sum->hard > 0.0f;
    out.height_d = select(a, fixed, hard);
    out.height_f = select((a + screening * sum->held) * target, target, hard);
    if (pinned) {
        MASK edge = x == 0 || x == n - 1 || MASK_OF(y == 0 || y == n - 1);
        out.height_d = select(out.height_d, PINNED, edge);
        out.height_f = select(out.height_f, zero, edge);
    }
    // a stiffness fades on the ground, not on the grid: in cells of level 4, else bands seem wider on every finer level
    float finer = fmax(octave / s, 1.0f), excess = finer * finer - 1.0f;
    REAL toe = CREST_STIFFNESS * sum->toe / (1.0f + excess * (1.0f - sum->toe * sum->toe)), g = fmax(sum->g, TINY);
    out.gradient_d = toe;
    out.gradient_fx = toe * sum->gx / g;
    out.gradient_fy = toe * sum->gy / g;
#ifdef OVER_BASE
    out.share = sum->toe * sum->share / g;
    out.target = target;
#endif
    return out;
}
