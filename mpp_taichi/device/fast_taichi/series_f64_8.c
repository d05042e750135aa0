/* Gravity by series of order 8 in f64: series_walk.h says how. */
#define IN_F32 0
#define P 8
#define NAME(function) function##_f64_8
#include "series_vectors.h"
#include "series_math.h"
#include "series_nodes.h"
#include "series_walk.h"
