// The hash functions of Blender's textures. Patterns agree with Blender's only if these agree bit for
// bit. Sources: Bob Jenkins, lookup3.c (public domain); Jarzynski and Olano, "Hash Functions for GPU
// Rendering", JCGT 2020 (in a signed variant: the shift keeps the sign, the sign bit is dropped last).
#pragma once
#include "luch/math/pack.h"

namespace luch {

template <class W>
LUCH_FN W rotate_left(W x, int bits) {
    return (x << bits) | (x >> (32 - bits));
}

// lookup3's state: three words; `absorb` stirs after a full block, `finish` ends it.
template <class W>
struct Lookup3 {
    W a, b, c;

    LUCH_FN explicit Lookup3(u32 words) { a = b = c = W{} + (0xdeadbeefu + (words << 2) + 13u); }

    LUCH_FN void absorb() {
        stir(a, c, b, 4);
        stir(b, a, c, 6);
        stir(c, b, a, 8);
        stir(a, c, b, 16);
        stir(b, a, c, 19);
        stir(c, b, a, 4);
    }
    LUCH_FN W finish() {
        fold(c, b, 14);
        fold(a, c, 11);
        fold(b, a, 25);
        fold(c, b, 16);
        fold(a, c, 4);
        fold(b, a, 14);
        fold(c, b, 24);
        return c;
    }

 private:
    LUCH_FN static void stir(W& x, W& y, const W& z, int bits) {
        x -= y;
        x ^= rotate_left(y, bits);
        y += z;
    }
    LUCH_FN static void fold(W& x, const W& y, int bits) {
        x ^= y;
        x -= rotate_left(y, bits);
    }
};

template <class W>
LUCH_FN W hash_words(W x) {
    Lookup3<W> h(1);
    h.a += x;
    return h.finish();
}
template <class W>
LUCH_FN W hash_words(W x, W y) {
    Lookup3<W> h(2);
    h.a += x;
    h.b += y;
    return h.finish();
}
template <class W>
LUCH_FN W hash_words(W x, W y, W z) {
    Lookup3<W> h(3);
    h.a += x;
    h.b += y;
    h.c += z;
    return h.finish();
}
template <class W>
LUCH_FN W hash_words(W x, W y, W z, W w) {
    Lookup3<W> h(4);
    h.a += x;
    h.b += y;
    h.c += z;
    h.absorb();
    h.a += w;
    return h.finish();
}

// The bits of one to four floats -> [0, 1].
template <class F, class... Rest>
LUCH_FN F hash_unit(F x, Rest... rest) {
    return lane_float(hash_words(lane_bits(x), lane_bits(rest)...)) * 2.3283064365386963e-10f;  // 2^-32
}

// Two to four integers -> as many values in [0, 1].
template <class F, int D>
LUCH_FN Coord<F, D> hash_cell(const IntOf<F> (&cell)[D]) {
    using Word = WordOf<F>;
    Word v[D];
    for (int d = 0; d < D; d++) v[d] = lane_word(cell[d]) * 1664525u + 1013904223u;
    for (int round = 0; round < 2; round++) {
        if constexpr (D == 2) {
            v[0] += v[1] * 1664525u;
            v[1] += v[0] * 1664525u;
        } else if constexpr (D == 3) {
            v[0] += v[1] * v[2];
            v[1] += v[2] * v[0];
            v[2] += v[0] * v[1];
        } else {
            v[0] += v[1] * v[3];
            v[1] += v[2] * v[0];
            v[2] += v[0] * v[1];
            v[3] += v[1] * v[2];
        }
        if (round == 0) {
            for (int d = 0; d < D; d++) v[d] ^= lane_word(lane_signed(v[d]) >> 16);
        }
    }
    Coord<F, D> unit;
    for (int d = 0; d < D; d++)
        unit.x[d] = lane_float(lane_signed(v[d] & 0x7fffffffu)) * 4.656612873077393e-10f;  // 2^-31
    return unit;
}

}  // namespace luch
