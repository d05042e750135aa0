/* Gravity by series of order 6 in f64: series_walk.h says how. */
#define IN_F32 0
#define P 6
#define NAME(function) function##_f64_6
#include "series_vectors.h"
#include "series_math.h"
#include "series_nodes.h"
#include "series_walk.h"
