// Claim: the unit of length does not matter. With lengths times s, Young's modulus times s, density
// over s (so that the speed of sound is s times as large and times stay) and forces times s^3 every
// strain is the same at the same step, hence the share of the example reached, the weights and the
// number of Newton iterations. Nothing in the chain - eigenpairs, maps, modes, cubature, steps -
// may know a length of its own. Scales are powers of two: they change no rounding, so that the
// greedy choice of elements does not turn on the last bit.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "box.h"
#include "program.h"

typedef struct outcome {
  double fraction, weight, newton;
} outcome;

// A box of length s with lengths, times and forces scaled; the example has other connectivity, so
// that the maps take part.
static outcome run_at(double s) {
  char text[2000];
  write_box("beam.veg", 8, 2, 2, s, 0, 3e4);
  write_box("rest.veg", 10, 3, 2, s, 0, 3e4);
  write_box("bent.veg", 10, 3, 2, s, 0.3 / s, 3e4);
  snprintf(text, sizeof text,
           "schema: 1\nname: beam\nobject: {mesh: beam.veg,\n"
           "  material: {density: %.17g, young: %.17g, poisson: 0.4}}\n"
           "fixed: [{box: {low: [%g, %g, %g], high: [%g, %g, %g]}}]\n"
           "families: [{rest: rest.veg, poses: [bent.veg], map: {frame: authored, accept: true}}]\n"
           "reduction: {eigenfunctions: 5, modes: 10, linear_modes: 6, path_samples: 2,\n"
           "  elements: 30, training_poses: 30, amplitude: 0.1}\n"
           "simulation: {dt: 0.02, steps: 40, damping: {mass: 0.5, stiffness: 0.05}}\n"
           "loads: [{push: {box: {low: [%g, %g, %g], high: [%g, %g, %g]}, "
           "force: [0, %.17g, 0], ramp: 0.2}}]\n"
           "output: {formats: []}\n",
           0.05 / s, 1.5 * s, -s, -s, -s, 0.01 * s, s, s, 0.95 * s, -s, -s, 2 * s, 2 * s, 2 * s,
           2e-4 * s * s * s);
  write_text("beam.yaml", text);
  if (program("", "run beam.yaml --json --out results --cache cache-%g", s) != 0)
    fail_msg("scale %g: %s", s, text_of("err.txt"));
  json_t *root = report();
  const outcome out = {.fraction = number(root, "example_fraction"),
                       .weight =
                           json_number_value(json_array_get(json_object_get(root, "weights"), 1)),
                       .newton = number(root, "newton_iterations")};
  assert_true(number(root, "inverted_tets") == 0);
  json_decref(root);
  return out;
}

// 1e-5: what tolerances of the interpolation (1e-6) and of the steps (1e-6) let differ.
static void lengths_do_not_matter(void **state) {
  (void)state;
  const outcome one = run_at(1);
  assert_true(one.fraction > 0.05);
  static const double scales[] = {0x1p-20, 0x1p-10, 0x1p10, 0x1p20};
  for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
    const outcome other = run_at(scales[i]);
    if (fabs(other.fraction - one.fraction) > 1e-5 * one.fraction ||
        fabs(other.weight - one.weight) > 1e-5 || fabs(other.newton - one.newton) > 4)
      fail_msg("scale %g: fraction %.9g (%.9g), weight %.9g (%.9g), iterations %g (%g)", scales[i],
               other.fraction, one.fraction, other.weight, one.weight, other.newton, one.newton);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(lengths_do_not_matter)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
