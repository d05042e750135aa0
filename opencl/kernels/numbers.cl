/* Numbers of one precision, for all kernels. Built with -DREAL=float or double, and -DNEEDS_FP64 for the latter.
 *
 * Vectors of particles are padded to four numbers, of which the last is zero, or stored component by component.
 */
#ifdef NEEDS_FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define REAL4 JOINED(REAL, 4)

static inline REAL dot3(const REAL4 a, const REAL4 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
