// What strokes want of samples: cross-sections and their commutative sums (DESIGN 5.2, 5.4); after nearest.cl, which has
// the tables, the types and the macros. Twin: backend/esker/solve/constraints/section_reference.py.

// A stroke's band where samples are: its flank there, and how far it goes. sure: see reference_section.Flanks.
typedef struct {
    REAL d, ds, present, there, sure, slope, run, extent, k, f, top, full, end;
    MASK hard, has, within;
} band_t;

INLINE band_t band_of(const nearest_t *near, MASK inside, global const float *p, float s) {
    band_t b;
    REAL zero = 0.0f, one = 1.0f;
    b.d = fmax(select(near->distance, zero, inside) - p[P_PLATEAU] + select(near->rest, zero, inside), 0.0f);
    b.ds = b.d * s;
    b.hard = inside || near->square < p[P_CREST2];
    b.within = inside || near->distance <= p[P_REACH];
    b.top = fabs(near->height);
    if (p[P_SAME] > 0.0f) {
        b.present = p[P_RH];
        b.there = p[P_RH];
        b.has = MASK_OF(p[P_RH] > 0.0f);
        b.slope = p[P_RS];
        b.run = p[P_RUN];
        b.extent = p[P_RE];
        b.k = p[P_RK];
        b.f = p[P_RF];
    } else {
        REAL left = near->left * p[P_LH], right = near->right * p[P_RH];
        b.present = left + right;
        b.there = fmin(b.present * (1.0f / FULL_SAY), 1.0f);
        b.has = b.present > TINY;
        // Products, not a difference: a slope of almost nothing beside a steep one must not round to nothing.
        REAL all = 1.0f / fmax(b.present, TINY), share = fmin(left * all, 1.0f), rest = fmin(right * all, 1.0f);
        b.slope = select(one, rest * p[P_RS] + share * p[P_LS], b.has);
        b.run = 1.0f / b.slope;
        b.extent = rest * p[P_RE] + share * p[P_LE];
        b.k = rest * p[P_RK] + share * p[P_LK];
        b.f = rest * p[P_RF] + share * p[P_LF];
    }
    b.sure = b.there * b.there * b.there;
#ifdef OVER_BASE
    b.present *= p[P_CUT] + clamp(near->height * (1.0f / BALANCE_M) + 0.5f, 0.0f, 1.0f) * (p[P_FILL] - p[P_CUT]);
#endif
    REAL low = fmin(b.top * (1.0f / LOWEST_M), 1.0f);
    b.full = (1.0f + b.k + b.f) * b.top * b.run * (low * low * low);
    b.end = select(zero, fmin(b.extent, b.full), b.has);
    return b;
}

// Height, fall per metre and change with the crest height of a flank d metres from the crest, at most its full width
// (reference_section.flank_profile). A compiler that fuses the product in `full` with the difference finds it a rounding
// below zero where the flank ends: a flank without a foot would take that for one, of no height.
INLINE void flank_profile(const band_t *b, REAL d, REAL *z, REAL *fall, REAL *lift) {
    REAL half_square = 0.5f * b->slope * b->slope, rest = fmax(b->full - d, 0.0f), top = b->top, k = b->k, f = b->f;
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
    REAL q = b->ds / fmax(NEAR_SHARE * b->there * b->end, NEAR_FLOOR * fmax(t->s, t->octave));
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
    if (p[P_LB] + p[P_RB] > 0.0f) {
        REAL bank = near->left * p[P_LB] + near->right * p[P_RB];
        sum->quiet = fmax(sum->quiet, select(zero, smooth(1.0f - b.d / fmax(bank, TINY)), b.within));
    }
    MASK reached = b.within && (b.hard || (b.has && rt < toe_end));
    if (!ANY(reached)) return;
    REAL z, fall, lift, free = 0.0f, skirted = 0.0f;
    flank_profile(&b, b.there * fmin(b.ds, b.end), &z, &fall, &lift);
    if (t->edition >= PAIRS_EDITION) {  // on a plateau, where a crest has no height, too
        z = select(z, b.top, b.ds <= NO_LENGTH_M);
        lift = select(lift, one, b.ds <= NO_LENGTH_M);
    }
#ifdef OVER_BASE
    REAL follows = lift;
#endif
    REAL held = 1.0f;
    if (ANY(r > SPRING_FULL_FRACTION)) {
        free = smooth((r - SPRING_FULL_FRACTION) * (1.0f / (1.0f - SPRING_FULL_FRACTION)));
        REAL over = fmax(b.ds - b.end, 0.0f), past = 1.0f + over * t->decay;
        REAL level = fmin(8.0f * (1.0f - b.end / fmax(b.full, TINY)), 1.0f), rest = fmax(1.0f - over / fmax(width, TINY), 0.0f);
        REAL out = fmin(over / fmax(EDGE_CELLS * t->s, EDGE_SHARE * b.end), 1.0f), off = free * level * (1.0f - need);
        REAL leaving = off + out * (1.0f - off), skirt_lift = need * foot_lift * rest * rest;
        REAL exit = fmin(fall, EXIT_SHARE * t->decay * z) / (past * past);
        REAL down = 2.0f * foot_height * rest / fmax(width, TINY);
        fall += leaving * (exit + need * (down - exit) - fall);
        z += out * need * (foot_height * rest * rest - z);
#ifdef OVER_BASE
        follows = lift * (1.0f - off);
        follows += out * (skirt_lift - follows);
#endif
        lift += out * (skirt_lift - lift);
        REAL ends = b.ds / fmax(b.end + width, THINNEST_M);
        held = smooth((1.0f - ends) * (1.0f / (1.0f - HELD_FRACTION)));
        skirted = SLIGHT * b.present * b.sure * free * held * p[P_SKIRT];
    }
    lift = select(one, lift, b.has);
    REAL sign = select(one, -one, near->height < 0.0f);
    REAL down = select(zero, lift * near->rate - sign * fall, b.has && near->square > p[P_PLATEAU2] && !inside);
    REAL near_weight = nearness(&b, t) * p[P_SAY], inner = fmax(1.0f - r, 0.0f), outer = fmax(1.0f - rt / toe_end, 0.0f);
    REAL fade = select(zero, select(b.present * (1.0f - free), one, b.hard), reached);
    REAL toe = select(zero, b.present * smooth((toe_end - rt) / (toe_end - 1.0f)), reached && b.has);
    REAL w = near_weight * (fade * select(inner * inner * b.sure, one, b.hard) + select(zero, skirted, reached));
    REAL g = near_weight * toe * outer * outer * b.sure, a = SPRING_CELLS * t->s * wide;
    REAL unit = down / fmax(near->distance, 0.5f);
#ifdef OVER_BASE
    sum->share += g * select(one, follows, b.has);
#endif
    lift = select(lift * (1.0f / t->s), zero, inside);
    if (t->edition >= PAIRS_EDITION) {
        REAL joint = sum->w * (w / fmax(sum->w + w, LEAST)), gap = sign * z - sum->wt / fmax(sum->w, LEAST);
        sum->wtt += joint * gap * gap;
        sum->joint += joint;
    } else {
        sum->wtt += w * z * z;
    }
    sum->w += w;
    sum->wt += w * sign * z;
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
        REAL painted = smooth(1.0f - near->distance * (1.0f / p[P_BRUSH]));
        sum->g += painted;
        sum->gx += painted * p[P_VALUE];
        sum->toe = fmax(sum->toe, painted);
        return;
    }
    band_t b = band_of(near, inside, p, t->s);
    REAL zero = 0.0f, one = 1.0f, r = b.ds / fmax(b.end, CHANNEL_FLOOR_CELLS * t->s);
    REAL known = select(b.present * smooth((TOE - r) * (1.0f / (TOE - 1.0f))), one, b.hard);
    known = select(zero, known, b.within);
    REAL outer = fmax(1.0f - r * (1.0f / TOE), 0.0f);
    REAL g = known * nearness(&b, t) * p[P_SAY] * select(outer * outer * b.sure, one, b.hard);
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
    *f = *cover * sum->gx / fmax(sum->g, LEAST);
}

// x: columns of the samples, y their row, n samples a side; a pinned border is fixed at the base.
INLINE constraint_t conclude(const sums_t *sum, MASK x, int y, int n, float screening, int pinned, const tables_t *t) {
    constraint_t out;
    REAL zero = 0.0f, fixed = -1.0f;
    REAL w = fmax(sum->w, LEAST), target = sum->wt / w;
    REAL square = sum->wtt / w, apart = fmax(square * (1.0f - AGREEMENT_NOISE) - target * target, 0.0f);
    if (t->edition >= PAIRS_EDITION) {
        apart = square;
        square += target * target;
    }
    REAL quarrel = apart / (apart + AGREEMENT * square + TINY);
    if (t->edition >= PAIRS_EDITION) quarrel *= sum->joint / (sum->joint + AGREEMENT * w);
    REAL a = sum->wa / w;
    a = (a + fmin(OVERLAP_STIFFENING * a, OVERLAP_STIFFEST) * quarrel * quarrel) * sum->fade * (1.0f - sum->quiet);
    MASK hard = sum->hard > 0.0f;
    out.height_d = select(a, fixed, hard);
    out.height_f = select((a + screening * sum->held) * target, target, hard);
    if (pinned) {
        MASK edge = x == 0 || x == n - 1 || MASK_OF(y == 0 || y == n - 1);
        out.height_d = select(out.height_d, PINNED, edge);
        out.height_f = select(out.height_f, zero, edge);
    }
    // a stiffness fades on the ground, not on the grid: in cells of level 4, else bands seem wider on every finer level
    float finer = fmax(t->octave / t->s, 1.0f), excess = finer * finer - 1.0f;
    REAL toe = CREST_STIFFNESS * sum->toe / (1.0f + excess * (1.0f - sum->toe * sum->toe)), g = fmax(sum->g, LEAST);
    out.gradient_d = toe;
    out.gradient_fx = toe * sum->gx / g;
    out.gradient_fy = toe * sum->gy / g;
#ifdef OVER_BASE
    out.share = sum->toe * sum->share / g;
    out.target = target;
#endif
    return out;
}
