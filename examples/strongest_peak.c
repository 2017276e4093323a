/* The strongest echo of each frame, as a detector in another language: reads amplitudes, writes a results file.
 *
 *   cc -O2 -o strongest_peak strongest_peak.c
 *   ./strongest_peak NAME.f32 TAPS SAMPLE_INTERVAL_S > NAME.csv
 *
 * NAME.f32 holds 32-bit numbers, frame after frame. The strongest tap of a frame is taken for the direct path, and the
 * strongest local maximum at least GUARD taps behind it for the echo; its delay counts from the direct path.
 */
#include <stdio.h>
#include <stdlib.h>

#define GUARD 5

int main(int count, char **words) {
    if (count != 4) {
        fprintf(stderr, "usage: %s NAME.f32 TAPS SAMPLE_INTERVAL_S\n", words[0]);
        return 2;
    }
    const int taps = atoi(words[2]);
    const double interval_s = atof(words[3]);
    FILE *file = fopen(words[1], "rb");
    float *a = taps > 2 ? malloc((size_t)taps * sizeof *a) : NULL;
    if (!file || !a || interval_s <= 0) {
        fprintf(stderr, "%s: cannot be read so\n", words[1]);
        return 1;
    }
    puts("frame,delay_s,amplitude");
    for (long frame = 0; fread(a, sizeof *a, (size_t)taps, file) == (size_t)taps; frame++) {
        int direct = 0, echo = -1;
        for (int k = 1; k < taps; k++)
            if (a[k] > a[direct]) direct = k;
        for (int k = direct + GUARD; k + 1 < taps; k++)
            if (a[k] > a[k - 1] && a[k] >= a[k + 1] && (echo < 0 || a[k] > a[echo])) echo = k;
        if (echo >= 0) printf("%ld,%.9g,%.9g\n", frame, (echo - direct) * interval_s, a[echo]);
    }
    free(a);
    fclose(file);
    return 0;
}
