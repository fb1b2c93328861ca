// Elementary functions under our own names, so that one definition serves both compilers.
#pragma once
#include "luch/math/vec.h"

namespace luch {

LUCH_FN float sin_f(float x) { return __builtin_sinf(x); }
LUCH_FN float cos_f(float x) { return __builtin_cosf(x); }
LUCH_FN float tan_f(float x) { return __builtin_tanf(x); }
LUCH_FN float asin_f(float x) { return __builtin_asinf(clamp_f(x, -1.0f, 1.0f)); }
LUCH_FN float acos_f(float x) { return __builtin_acosf(clamp_f(x, -1.0f, 1.0f)); }
LUCH_FN float atan_f(float x) { return __builtin_atanf(x); }
LUCH_FN float atan2_f(float y, float x) { return __builtin_atan2f(y, x); }
LUCH_FN float exp_f(float x) { return __builtin_expf(x); }
LUCH_FN float exp2_f(float x) { return __builtin_exp2f(x); }
LUCH_FN float log_f(float x) { return __builtin_logf(x); }
LUCH_FN float log2_f(float x) { return __builtin_log2f(x); }
LUCH_FN float pow_f(float x, float y) { return __builtin_powf(x, y); }
LUCH_FN float fmod_f(float x, float y) { return __builtin_fmodf(x, y); }
LUCH_FN float trunc_f(float x) { return __builtin_truncf(x); }
LUCH_FN float ceil_f(float x) { return __builtin_ceilf(x); }
LUCH_FN float round_f(float x) { return __builtin_floorf(x + 0.5f); }
LUCH_FN float fract_f(float x) { return x - __builtin_floorf(x); }

}  // namespace luch
