// A thousand steps end in the same bits on every instruction-set level: the kernels sum in one
// order, with lanes of one width and no fused multiply-adds. Printed hashes compare builds: gcc and
// clang, -O1 and -O3, must print the same ones. Not promised: NLopt as solver of the interpolation
// (its own arithmetic is compiled elsewhere) and another libm, whose log1p stable neo-Hookean uses.
#include <inttypes.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/state.h"
#include "tests/reduced/bar.h"
#include "tests/reduced/quartic.h"

enum { R = 30, STEPS = 1000 };

// FNV-1a over the bytes.
static void add(uint64_t *hash, const double *x, size_t count) {
  const unsigned char *bytes = (const unsigned char *)x;
  for (size_t i = 0; i < count * sizeof *x; i++) *hash = (*hash ^ bytes[i]) * 0x100000001b3;
}

// Positions and velocities of all steps under a load that comes and goes.
static uint64_t run(const ep_model *model, const double *load, ep_isa isa) {
  const size_t bytes = ep_state_bytes(model);
  void *block = aligned_alloc(64, bytes);
  ep_state *s = NULL;
  assert_non_null(block);
  assert_int_equal(ep_state_init(model, block, bytes, &s), EP_OK);
  assert_int_equal(ep_state_use_isa(s, ep_isa_name(isa)), EP_OK);
  assert_string_equal(ep_state_isa(s), ep_isa_name(isa));
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.002;
  uint64_t hash = 0xcbf29ce484222325;
  for (int step = 0; step < STEPS; step++) {
    def.force = step % 200 < 60 ? load : NULL;
    assert_int_equal(ep_step(s, &def, NULL), EP_OK);
    add(&hash, ep_state_q(s), R), add(&hash, ep_state_velocity(s), R);
  }
  free(block);
  return hash;
}

static void all_levels(const char *name, const ep_model *model, const double *load) {
  const int count = ep_isa_here() + 1;
  const uint64_t first = run(model, load, EP_ISA_BASELINE);
  for (int i = 1; i < count; i++) assert_true(run(model, load, (ep_isa)i) == first);
  print_message("%s: %016" PRIx64 " on %d levels\n", name, first, count);
}

static void make_load(bar *b, double *load) {
  void *block;
  double q[R];
  bar_random_q(b, 0.3, q);
  ep_elastic_energy(bar_state(b, &block), q, load, NULL, 0);
  free(block);
}

static void cubature_with_examples(void **state) {
  (void)state;
  bar *b = bar_create(6, 2, 1, R, 40, 6, 2, EP_STVK_VOLUME);
  double load[R];
  make_load(b, load);
  all_levels("cubature, two examples", &b->model, load);
  bar_add_guards(b, 61, 0.9); // high enough that the load reaches them
  all_levels("with guards", &b->model, load);
  bar_free(b);
}

static void polynomials(void **state) {
  (void)state;
  bar *b = bar_create(6, 2, 1, R, 0, 0, 0, EP_STVK);
  double *packed = quartic_coefficients(b), load[R];
  const size_t count = ep_cubic_stream_size(R, EP_DOUBLE);
  double *stream = aligned_alloc(64, (count * sizeof *stream + 63) / 64 * 64);
  assert_non_null(stream);
  assert_int_equal(ep_cubic_pack(R, packed, stream), EP_OK);
  make_load(b, load);
  ep_model model = b->model;
  model.size.cubic = (int)count, model.cubic_stream = stream;
  model.evaluator = EP_EVALUATE_CUBIC;
  all_levels("polynomials", &model, load);
  free(packed), free(stream);
  bar_free(b);
}

// Only what there is: another name, or a level this processor does not run, changes nothing.
static void other_levels_are_refused(void **state) {
  (void)state;
  bar *b = bar_create(2, 1, 1, 6, 6, 0, 0, EP_STVK);
  void *block;
  ep_state *s = bar_state(b, &block);
  assert_string_equal(ep_state_isa(s), ep_isa_name(ep_isa_here()));
  assert_int_equal(ep_state_use_isa(s, "sse9"), EP_ERR_ARGUMENT);
  for (int isa = ep_isa_here() + 1; isa < EP_ISAS; isa++)
    assert_int_equal(ep_state_use_isa(s, ep_isa_name((ep_isa)isa)), EP_ERR_UNSUPPORTED);
  assert_string_equal(ep_state_isa(s), ep_isa_name(ep_isa_here()));
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cubature_with_examples),
      cmocka_unit_test(polynomials),
      cmocka_unit_test(other_levels_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
