/* The detector `paper-filtering` without phase differences, as fast as exact code is known to be: the floor against
 * which the benchmark holds the project's own kernel. Nothing here is approximated, and no operation is reordered:
 * prominences and widths equal the project's to the last bit.
 *
 * `detect_all` computes every property of every peak. `detect_first` visits the peaks by falling amplitude and stops at
 * the first that passes all filters, which is the one that would be kept; it is written for AVX-512, with one frame in
 * registers and sets of taps as bits of one word (64 taps at most), and in plain C for processors without.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>

#define MOST_TAPS 64

typedef struct {
    int32_t taps, noise_taps, search_taps, guard_taps;
    double minimum_prominence, minimum_width, relative_height, minimum_score_db;
    double gain_db_per_ns, sample_interval_s, speed_m_s, distance_m, along_m;
} Settings;

typedef struct {
    int64_t *frame, *tap;
    double *amplitude, *prominence, *width, *score_db, *delay_s, *range_m;
} Columns;

typedef struct {
    int tap;
    double amplitude, prominence, width, score_db;
} Peak;

/* Root mean square of the leading taps, scaled by the largest so that small squares do not vanish. */
static inline double noise_rms(const double *a, int taps)
{
    double largest = 0.0, sum = 0.0;
    for (int i = 0; i < taps; i++)
        largest = a[i] > largest ? a[i] : largest;
    const double unit = largest > 0.0 ? largest : 1.0;
    for (int i = 0; i < taps; i++)
        sum += (a[i] / unit) * (a[i] / unit);
    return largest * sqrt(sum / taps);
}

static inline double score(const Settings *s, double amplitude, double noise, int delay_taps)
{
    if (!(amplitude > 0.0 && noise > 0.0))
        return NAN;
    return 20.0 * (log10(amplitude) - log10(noise)) + s->gain_db_per_ns * (delay_taps * (s->sample_interval_s * 1e9));
}

/* Fraction of a tap from the low side of a slope to where it crosses `level`. */
static inline double share(double level, double low, double high)
{
    return low < level ? (level - low) / (high - low) : 0.0;
}

static inline void store(const Settings *s, const Columns *out, long n, long frame, const Peak *peak, int first_path)
{
    const double delay_s = (peak->tap - first_path) * s->sample_interval_s;
    const double excess_m = delay_s * s->speed_m_s;
    out->frame[n] = frame;
    out->tap[n] = peak->tap;
    out->amplitude[n] = peak->amplitude;
    out->prominence[n] = peak->prominence;
    out->width[n] = peak->width;
    out->score_db[n] = peak->score_db;
    out->delay_s[n] = delay_s;
    out->range_m[n] = excess_m * (excess_m + 2.0 * s->distance_m) / (2.0 * (excess_m + (s->distance_m - s->along_m)));
}

/* Least value between each tap and the next higher one on its left (step 1) or right (step -1), in linear time: the
 * stack holds the taps that nothing since has reached, highest first. */
static void lowest_beside(const double *p, int from, int to, int step, double *lowest)
{
    int stack[MOST_TAPS], depth = 0;
    for (int i = from; i != to; i += step) {
        double least = p[i];
        while (depth > 0 && p[stack[depth - 1]] <= p[i]) {
            depth--;
            least = lowest[stack[depth]] < least ? lowest[stack[depth]] : least;
        }
        lowest[i] = least;
        stack[depth++] = i;
    }
}

typedef struct {
    double amplitude[MOST_TAPS], profile[MOST_TAPS];
    int first_path;
} Frame;

/* Magnitudes, profile and first path of a frame; 0 where nothing stands out. */
static inline int scaled(const float *iq, const Settings *s, Frame *f)
{
    const int taps = s->taps, start = s->noise_taps;
    double *a = f->amplitude, lowest = INFINITY, highest = -INFINITY;
    for (int i = 0; i < taps; i++) {
        const double re = iq[2 * i], im = iq[2 * i + 1];
        a[i] = sqrt(re * re + im * im);
    }
    for (int i = start; i < taps; i++) {
        lowest = a[i] < lowest ? a[i] : lowest;
        highest = a[i] > highest ? a[i] : highest;
    }
    const double span = highest - lowest;
    if (!(span > 8 * DBL_EPSILON * highest))
        return 0;
    for (int i = start; i < taps; i++)
        f->profile[i] = (a[i] - lowest) / span;
    f->first_path = start;
    for (int i = start; i < taps && i < start + s->search_taps; i++)
        f->first_path = a[i] > a[f->first_path] ? i : f->first_path;
    return 1;
}

/* Middle, rounded down, of each local maximum. */
static inline int maxima(const double *p, int start, int taps, int *found)
{
    int n = 0;
    for (int i = start + 1; i < taps - 1; i++) {
        int end = i;
        if (!(p[i - 1] < p[i]))
            continue;
        while (end < taps - 1 && p[end + 1] == p[i])
            end++;
        if (end < taps - 1 && p[end + 1] < p[i])
            found[n++] = (i + end) / 2;
        i = end;
    }
    return n;
}

static inline double width(const Settings *s, const double *p, int tap, double prominence)
{
    const double level = p[tap] - prominence * s->relative_height;
    int l = tap, r = tap;
    while (p[l] > level)
        l--;
    while (p[r] > level)
        r++;
    const double begin = (l - s->noise_taps) + share(level, p[l], p[l + 1]);
    return ((r - s->noise_taps) - share(level, p[r], p[r - 1])) - begin;
}

long detect_all(const float *iq, long frames, const Settings *s, const Columns *out)
{
    const int taps = s->taps, start = s->noise_taps;
    long n = 0;
    for (long frame = 0; frame < frames; frame++, iq += 2 * taps) {
        Frame f;
        double left[MOST_TAPS], right[MOST_TAPS];
        int found[MOST_TAPS];
        if (!scaled(iq, s, &f))
            continue;
        const double noise = noise_rms(f.amplitude, start);
        lowest_beside(f.profile, start, taps, 1, left);
        lowest_beside(f.profile, taps - 1, start - 1, -1, right);
        Peak best = {.tap = -1};
        const int peaks = maxima(f.profile, start, taps, found);
        for (int k = 0; k < peaks; k++) {
            Peak peak = {.tap = found[k], .amplitude = f.amplitude[found[k]]};
            const int tap = peak.tap;
            peak.prominence = f.profile[tap] - (left[tap] > right[tap] ? left[tap] : right[tap]);
            peak.width = width(s, f.profile, tap, peak.prominence);
            peak.score_db = score(s, peak.amplitude, noise, tap - f.first_path);
            if (tap > f.first_path + s->guard_taps && peak.prominence >= s->minimum_prominence
                && peak.width >= s->minimum_width && peak.score_db >= s->minimum_score_db
                && (best.tap < 0 || peak.amplitude > best.amplitude))
                best = peak;
        }
        if (best.tap >= 0)
            store(s, out, n++, frame, &best, f.first_path);
    }
    return n;
}

long detect_first_plain(const float *iq, long frames, const Settings *s, const Columns *out)
{
    const int taps = s->taps, start = s->noise_taps;
    long n = 0;
    for (long frame = 0; frame < frames; frame++, iq += 2 * taps) {
        Frame f;
        int found[MOST_TAPS];
        if (!scaled(iq, s, &f))
            continue;
        const double *p = f.profile;
        int peaks = maxima(p, start, taps, found);
        while (peaks > 0) {
            int strongest = 0;
            for (int k = 1; k < peaks; k++)
                strongest = f.amplitude[found[k]] > f.amplitude[found[strongest]] ? k : strongest;
            const int tap = found[strongest];
            peaks--;
            for (int k = strongest; k < peaks; k++) /* in order, so that the earlier of equals comes first */
                found[k] = found[k + 1];
            if (tap <= f.first_path + s->guard_taps)
                continue;
            double left = p[tap], right = p[tap];
            for (int i = tap; i >= start && p[i] <= p[tap]; i--)
                left = p[i] < left ? p[i] : left;
            for (int i = tap; i < taps && p[i] <= p[tap]; i++)
                right = p[i] < right ? p[i] : right;
            Peak peak = {.tap = tap, .amplitude = f.amplitude[tap], .prominence = p[tap] - (left > right ? left : right)};
            if (!(peak.prominence >= s->minimum_prominence))
                continue;
            peak.width = width(s, p, tap, peak.prominence);
            peak.score_db = score(s, peak.amplitude, noise_rms(f.amplitude, start), tap - f.first_path);
            if (!(peak.width >= s->minimum_width && peak.score_db >= s->minimum_score_db))
                continue;
            store(s, out, n++, frame, &peak, f.first_path);
            break;
        }
    }
    return n;
}

#ifdef __AVX512F__
#include <immintrin.h>

const char *const instructions = "AVX-512";

typedef uint64_t Taps; /* bit i stands for tap i */

#define EACH(v) _Pragma("GCC unroll 8") for (int v = 0; v < vectors; v++)
#define LANES(set, v) ((__mmask8)((set) >> (8 * (v))))

static inline Taps between(int first, int last)
{
    return (~(Taps)0 << first) & (~(Taps)0 >> (63 - last));
}

/* Middle, rounded down, of every flat top; rare, as noise hardly ever repeats a value. */
static Taps flat_tops(Taps up, Taps equal, Taps down)
{
    Taps tops = 0;
    for (Taps starts = (up << 1) & equal; starts; starts &= starts - 1) {
        const int begin = __builtin_ctzll(starts);
        const int end = begin + __builtin_ctzll(~(equal >> begin));
        if (down >> end & 1)
            tops |= (Taps)1 << ((begin + end) / 2);
    }
    return tops;
}

static inline __attribute__((always_inline)) long detect(
    const float *iq, long frames, const Settings *s, const Columns *out, const int vectors)
{
    const int taps = s->taps, start = s->noise_taps;
    const int searched = start + s->search_taps < taps ? start + s->search_taps : taps;
    const Taps kept = between(start, taps - 1), window = between(start, searched - 1);
    const Taps pairs = between(start, taps - 2); /* taps that have a neighbour on the right */
    const __m512i parts = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 1, 3, 5, 7, 9, 11, 13, 15);
    const __m512d infinity = _mm512_set1_pd(INFINITY), minus_infinity = _mm512_set1_pd(-INFINITY);
    long n = 0;
    for (long frame = 0; frame < frames; frame++, iq += 2 * taps) {
        __m512d a[8], p[8];
        double amplitude[MOST_TAPS] __attribute__((aligned(64)));
        double profile[MOST_TAPS] __attribute__((aligned(64)));
        __m512d low = infinity, high = minus_infinity, crest = minus_infinity;
        EACH(v) {
            const int left = 2 * taps - 16 * v;
            const __m512 raw = left >= 16 ? _mm512_loadu_ps(iq + 16 * v)
                                          : _mm512_maskz_loadu_ps((__mmask16)((1u << left) - 1), iq + 16 * v);
            const __m512d sorted = _mm512_castps_pd(_mm512_permutexvar_ps(parts, raw));
            const __m512d re = _mm512_cvtps_pd(_mm256_castpd_ps(_mm512_castpd512_pd256(sorted)));
            const __m512d im = _mm512_cvtps_pd(_mm256_castpd_ps(_mm512_extractf64x4_pd(sorted, 1)));
            a[v] = _mm512_sqrt_pd(_mm512_add_pd(_mm512_mul_pd(re, re), _mm512_mul_pd(im, im)));
            low = _mm512_mask_min_pd(low, LANES(kept, v), low, a[v]);
            high = _mm512_mask_max_pd(high, LANES(kept, v), high, a[v]);
            crest = _mm512_mask_max_pd(crest, LANES(window, v), crest, a[v]);
            _mm512_store_pd(amplitude + 8 * v, a[v]);
        }
        const double lowest = _mm512_reduce_min_pd(low), highest = _mm512_reduce_max_pd(high);
        const double span = highest - lowest;
        if (!(span > 8 * DBL_EPSILON * highest))
            continue;
        const __m512d foot = _mm512_set1_pd(lowest), rise = _mm512_set1_pd(span);
        const __m512d direct = _mm512_set1_pd(_mm512_reduce_max_pd(crest));
        Taps crests = 0;
        EACH(v) {
            p[v] = _mm512_div_pd(_mm512_sub_pd(a[v], foot), rise);
            crests |= (Taps)_mm512_mask_cmp_pd_mask(LANES(window, v), a[v], direct, _CMP_EQ_OQ) << (8 * v);
            _mm512_store_pd(profile + 8 * v, p[v]);
        }
        const int first_path = __builtin_ctzll(crests);
        Taps up = 0, down = 0;
        EACH(v) {
            const __m512d beyond = v + 1 < vectors ? p[v + 1] : infinity;
            const __m512d next = _mm512_castsi512_pd(
                _mm512_alignr_epi64(_mm512_castpd_si512(beyond), _mm512_castpd_si512(p[v]), 1));
            up |= (Taps)_mm512_cmp_pd_mask(p[v], next, _CMP_LT_OQ) << (8 * v);
            down |= (Taps)_mm512_cmp_pd_mask(p[v], next, _CMP_GT_OQ) << (8 * v);
        }
        up &= pairs;
        down &= pairs;
        Taps waiting = (up << 1) & down;
        const Taps equal = pairs & ~(up | down);
        if (__builtin_expect(equal != 0, 0))
            waiting |= flat_tops(up, equal, down);
        const int guard = first_path + s->guard_taps;
        waiting = guard < 63 ? waiting & (~(Taps)0 << (guard + 1)) : 0;

        double noise = -1.0;
        while (waiting) {
            __m512d top = minus_infinity;
            EACH(v)
                top = _mm512_mask_max_pd(top, LANES(waiting, v), top, a[v]);
            const __m512d strongest = _mm512_set1_pd(_mm512_reduce_max_pd(top));
            Taps same = 0;
            EACH(v)
                same |= (Taps)_mm512_mask_cmp_pd_mask(LANES(waiting, v), a[v], strongest, _CMP_EQ_OQ) << (8 * v);
            Peak peak = {.tap = __builtin_ctzll(same)};
            const int tap = peak.tap;
            const Taps here = (Taps)1 << tap, before = here - 1, behind = ~before - here;
            waiting &= ~here;

            const double height = profile[tap];
            const __m512d crown = _mm512_set1_pd(height);
            Taps higher = 0;
            EACH(v)
                higher |= (Taps)_mm512_cmp_pd_mask(p[v], crown, _CMP_GT_OQ) << (8 * v);
            higher &= kept;
            const int from = higher & before ? 64 - __builtin_clzll(higher & before) : start;
            const int to = higher & behind ? __builtin_ctzll(higher & behind) - 1 : taps - 1;
            const Taps on_left = between(from, tap), on_right = between(tap, to);
            __m512d left = infinity, right = infinity;
            EACH(v) {
                left = _mm512_mask_min_pd(left, LANES(on_left, v), left, p[v]);
                right = _mm512_mask_min_pd(right, LANES(on_right, v), right, p[v]);
            }
            const double left_base = _mm512_reduce_min_pd(left), right_base = _mm512_reduce_min_pd(right);
            peak.prominence = height - (left_base > right_base ? left_base : right_base);
            if (!(peak.prominence >= s->minimum_prominence))
                continue;

            const double level = height - peak.prominence * s->relative_height;
            const __m512d cut = _mm512_set1_pd(level);
            Taps below = 0;
            EACH(v)
                below |= (Taps)_mm512_cmp_pd_mask(p[v], cut, _CMP_LE_OQ) << (8 * v);
            const int l = 63 - __builtin_clzll(below & (before | here)), r = __builtin_ctzll(below & (behind | here));
            const double begin = (l - start) + share(level, profile[l], profile[l + 1]);
            peak.width = ((r - start) - share(level, profile[r], profile[r - 1])) - begin;
            if (!(peak.width >= s->minimum_width))
                continue;
            if (noise < 0.0)
                noise = noise_rms(amplitude, start);
            peak.amplitude = amplitude[tap];
            peak.score_db = score(s, peak.amplitude, noise, tap - first_path);
            if (!(peak.score_db >= s->minimum_score_db))
                continue;
            store(s, out, n++, frame, &peak, first_path);
            break;
        }
    }
    return n;
}

long detect_first(const float *iq, long frames, const Settings *s, const Columns *out)
{
    switch ((s->taps + 7) / 8) { /* a known number of vectors stays in registers */
    case 1: return detect(iq, frames, s, out, 1);
    case 2: return detect(iq, frames, s, out, 2);
    case 3: return detect(iq, frames, s, out, 3);
    case 4: return detect(iq, frames, s, out, 4);
    case 5: return detect(iq, frames, s, out, 5);
    case 6: return detect(iq, frames, s, out, 6);
    case 7: return detect(iq, frames, s, out, 7);
    default: return detect(iq, frames, s, out, 8);
    }
}

#else

const char *const instructions = "no AVX-512: plain C";

long detect_first(const float *iq, long frames, const Settings *s, const Columns *out)
{
    return detect_first_plain(iq, frames, s, out);
}

#endif
