/* Philox4x64-10 and standard normals, the twin of models/noise.py.
   Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11. */

static uint64_t product(uint64_t a, uint64_t b, uint64_t *high)
{
#ifdef __SIZEOF_INT128__
    const unsigned __int128 whole = (unsigned __int128)a * b;
    *high = (uint64_t)(whole >> 64);
    return (uint64_t)whole;
#else
    const uint64_t mask = 0xFFFFFFFFu, al = a & mask, ah = a >> 32, bl = b & mask, bh = b >> 32;
    const uint64_t middle = ah * bl + (al * bl >> 32), other = al * bh + (middle & mask);
    *high = ah * bh + (middle >> 32) + (other >> 32);
    return a * b;
#endif
}

static void philox4x64(uint64_t x[4], uint64_t k0, uint64_t k1)
{
    for (int round = 0; round < 10; round++) {
        uint64_t high0, high1;
        const uint64_t low0 = product(0xD2E7470EE14C6C93u, x[0], &high0);
        const uint64_t low1 = product(0xCA5A826395121157u, x[2], &high1);
        x[0] = high1 ^ x[1] ^ k0;
        x[1] = low1;
        x[2] = high0 ^ x[3] ^ k1;
        x[3] = low0;
        k0 += 0x9E3779B97F4A7C15u;
        k1 += 0xBB67AE8584CAA73Bu;
    }
}

static void normal_pair(uint64_t a, uint64_t b, double *z)
{
    const double unit = 1.0 / 9007199254740992.0; /* 2^-53 */
    const double radius = sqrt(-2.0 * log((double)((a >> 11) + 1) * unit));
    const double angle = 6.283185307179586 * ((double)(b >> 11) * unit);
    z[0] = radius * cos(angle);
    z[1] = radius * sin(angle);
}

/* The standard normals of a task's call; writes `count` of them, one more if that is odd. */
static void normals(uint64_t seed, uint64_t stream, uint64_t call, int count, double *z)
{
    for (int drawn = 0; drawn < count; drawn += 4) {
        uint64_t x[4] = {call, (uint64_t)drawn / 4, 0, 0};
        philox4x64(x, seed, stream);
        normal_pair(x[0], x[1], z + drawn);
        if (drawn + 2 < count)
            normal_pair(x[2], x[3], z + drawn + 2);
    }
}
