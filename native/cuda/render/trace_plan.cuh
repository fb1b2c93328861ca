// First of all in a module that traces, before a header asks luch/plan.h: one module serves many scenes, and those in
// which something moves, or that have hair, have others (luch/cuda/trace.py). buildtools/kernels.py looks that it holds.
#pragma once
#ifndef LUCH_PLAN_MOTION
#define LUCH_PLAN_MOTION 0
#endif
#ifndef LUCH_PLAN_CURVES
#define LUCH_PLAN_CURVES 0
#endif
