// The instruction sets the kernels are compiled for (CMakeLists.txt), and which of them this
// processor runs. Every kernel comes in all of them and gives the same bits in all. Private to the
// run time.
#ifndef EP_REDUCED_ISA_H
#define EP_REDUCED_ISA_H

// Each runs what the ones before it run.
typedef enum ep_isa { EP_ISA_BASELINE, EP_ISA_AVX2, EP_ISA_AVX512, EP_ISAS } ep_isa;

// The widest one of this processor.
static inline ep_isa ep_isa_here(void) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2")) return EP_ISA_BASELINE;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return EP_ISA_AVX512;
  return EP_ISA_AVX2;
#else
  return EP_ISA_BASELINE;
#endif
}

static inline const char *ep_isa_name(ep_isa isa) {
  static const char name[EP_ISAS][16] = {"baseline", "avx2", "avx512"};
  return name[isa];
}

#endif
