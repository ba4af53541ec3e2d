/* The loop of garment_sim_ros/sim/solvers/relaxation/springs.py, one spring at a time, to be compiled with
   gcc -O3 -march=x86-64-v3 -ffast-math -shared -fPIC. */
#include <math.h>
#include <stdint.h>

void correct_springs(float *restrict x, const uint32_t *restrict particles,
                     const float *restrict rest_length, const float *restrict share,
                     int64_t springs, int64_t sweeps)
{
    for (int64_t n = 0; n < sweeps; n++)
        for (int64_t s = 0; s < springs; s++) {
            float *p = x + 3 * (uint64_t)particles[2 * s];
            float *q = x + 3 * (uint64_t)particles[2 * s + 1];
            float dx = p[0] - q[0], dy = p[1] - q[1], dz = p[2] - q[2];
            float excess = 1.0f - rest_length[s] / sqrtf(dx * dx + dy * dy + dz * dz + 1e-20f);
            float a = share[s] * excess, b = excess - a;
            p[0] -= a * dx;
            p[1] -= a * dy;
            p[2] -= a * dz;
            q[0] += b * dx;
            q[1] += b * dy;
            q[2] += b * dz;
        }
}
