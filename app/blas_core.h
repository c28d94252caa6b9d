// OpenBLAS 0.3.21 does not know recent processors and falls back to its slowest kernels there
// (6 GFLOP/s instead of 45 on one core).
#ifndef EP_APP_BLAS_CORE_H
#define EP_APP_BLAS_CORE_H

// Where OpenBLAS uses kernels older than the processor, set OPENBLAS_CORETYPE and run this program
// again with the same arguments, once. Returns where there is nothing to do or it cannot be done.
void ep_blas_core_check(char **argv);

// The core type to ask for, given the kernels in use and whether the processor has AVX2 with FMA
// and AVX-512; NULL where the kernels are good.
const char *ep_blas_core_better(const char *in_use, int avx2, int avx512);

#endif
