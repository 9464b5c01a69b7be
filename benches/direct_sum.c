// Direct sum of docs/theory.md eq. (1) for linear delays in double precision, as one would write it in C: a phasor that
// turns from sample to sample by a factor that turns itself, as phases are quadratic in time; 16 chirps side by side.

#include <complex.h>
#include <math.h>

enum { LANES = 16 };

// Samples (chirp, sample), whole groups of LANES chirps of at most 1024 samples. Times in seconds: `first` is that of
// sample 0 after the start of a ramp, `step` from sample to sample.
void direct_sum(const double *delay, const double *rate, const double complex *amplitude, long num_paths, double f0,
                double slope, double first, double step, const double *chirps, long num_chirps, long num_samples,
                double complex *out) {
    for (long group = 0; group < num_chirps; group += LANES) {
        static double sum_re[1024][LANES], sum_im[1024][LANES];
        for (long m = 0; m < num_samples; m++)
            for (long i = 0; i < LANES; i++) sum_re[m][i] = sum_im[m][i] = 0.0;
        for (long path = 0; path < num_paths; path++) {
            double v = rate[path], bend = step * step * slope * v * (2.0 - v);
            double a = creal(amplitude[path]), b = -cimag(amplitude[path]);
            double r_re = cos(2.0 * M_PI * bend), r_im = sin(2.0 * M_PI * bend);
            double p_re[LANES], p_im[LANES], q_re[LANES], q_im[LANES];
            for (long i = 0; i < LANES; i++) {
                // Phase at the first sample and its first difference, in turns.
                double tau = delay[path] + v * (chirps[group + i] + first);
                double at = f0 * tau + slope * tau * (first - 0.5 * tau);
                double turn = step * (v * f0 + slope * (tau + v * first - v * tau)) + 0.5 * bend;
                at = 2.0 * M_PI * (at - floor(at)), turn = 2.0 * M_PI * (turn - floor(turn));
                double c = cos(at), s = sin(at);
                p_re[i] = c * a - s * b, p_im[i] = s * a + c * b;
                q_re[i] = cos(turn), q_im[i] = sin(turn);
            }
            for (long m = 0; m < num_samples; m++)
                for (long i = 0; i < LANES; i++) {
                    double p = p_re[i], q = q_re[i];
                    sum_re[m][i] += p, sum_im[m][i] += p_im[i];
                    p_re[i] = p * q - p_im[i] * q_im[i], p_im[i] = p * q_im[i] + p_im[i] * q;
                    q_re[i] = q * r_re - q_im[i] * r_im, q_im[i] = q * r_im + q_im[i] * r_re;
                }
        }
        for (long i = 0; i < LANES; i++)
            for (long m = 0; m < num_samples; m++)
                out[(group + i) * num_samples + m] = sum_re[m][i] + I * sum_im[m][i];
    }
}
