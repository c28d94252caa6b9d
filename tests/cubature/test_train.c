// Claims. Element forces add up to U^T f of the full space; forces relative to an example are the
// gradient of sum V |det F_i| psi(F F_i^-1) and vanish at the example. All elements with their own
// volumes have no error, none have error 1. Path stations minimise |E(q) - w E(q_i)|_D. Poses keep
// to the amplitude, do not crush elements, repeat for a seed. Training gives ascending elements,
// positive weights, errors that fall with size, and the same bytes whatever else was asked for.
#include "cubature/cubature.h"
#include "cubature/select.h"
#include "cubature/system.h"
#include "tests/bake/bar.h"
#include "tests/petsc_session.h"

enum { R = 12, EXAMPLES = 2 };

typedef struct fixture {
  bar b;
  ep_modes modes;
  ep_basis basis;
  ep_elements elements;
} fixture;

// A bar with two examples: bent by about 50 degrees, and twisted.
static void bend_and_twist(const bar *b, double *poses) {
  for (size_t v = 0; v < (size_t)b->mesh.nv; v++) {
    const double *x = b->mesh.x + 3 * v, s = x[0] / 4, angle = 0.9 * s, turn = 1.2 * s;
    double *bent = poses + 3 * v, *twisted = poses + b->n3 + 3 * v;
    if (b->fem.held[3 * v]) continue; // exactly 0 there
    const double radius = 4 / 0.9, z = x[2] - 0.5, y = x[1] - 0.5;
    bent[0] = (radius - z) * sin(angle) - x[0];
    bent[2] = radius - (radius - z) * cos(angle) - z;
    twisted[1] = cos(turn) * y - sin(turn) * z - y;
    twisted[2] = sin(turn) * y + cos(turn) * z - z;
  }
}

static void make_fixture(fixture *f, int examples, const double *poses) {
  make_bar(&f->b, (int[3]){8, 3, 3}, (double[3]){4, 1, 1}, EP_STVK_VOLUME,
           (ep_elastic){1000, 1e5, 0.4}, 1);
  double *own = vector_of(EXAMPLES * f->b.n3);
  bend_and_twist(&f->b, own);
  ASSERT_OK(ep_modes_compute(&f->b.fem, 6, NULL, &f->modes, err));
  ASSERT_OK(ep_basis_build(&f->b.fem, &f->modes, examples, poses ? poses : own, 0, NULL, R, NULL,
                           &f->basis, err));
  ASSERT_OK(ep_elements_create(&f->b.fem, &f->basis, &f->elements, err));
  free(own);
}

static void free_fixture(fixture *f) {
  ep_elements_free(&f->elements);
  ep_basis_free(&f->basis);
  ep_modes_free(&f->modes);
  free_bar(&f->b);
}

// Random reduced coordinates with vertex displacements of a few tenths.
static void random_q(const fixture *f, uint64_t seed, double size, double *q) {
  ep_random rng = ep_random_seed(seed, 9);
  for (int a = 0; a < R; a++)
    q[a] = size * ep_random_normal(&rng) / sqrt(f->basis.stiffness[a * R + a]);
}

static void sum_forces(const fixture *f, const ep_pose *pose, double *sum) {
  double one[R];
  memset(sum, 0, R * sizeof *sum);
  for (int e = 0; e < f->elements.nt; e++) {
    ep_element_force(&f->elements, e, pose, one);
    for (int a = 0; a < R; a++) sum[a] += f->b.fem.volume[e] * one[a];
  }
}

static void test_forces_add_up(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, 0, NULL);
  double q[R], sum[R], *u = vector_of(f.b.n3), *force = vector_of(f.b.n3);
  random_q(&f, 1, 60, q);
  for (int a = 0; a < R; a++)
    for (size_t i = 0; i < f.b.n3; i++) u[i] += q[a] * f.basis.u[(size_t)a * f.b.n3 + i];
  ASSERT_LESS(0.02, norm_of(f.b.n3, u)); // not the rest shape
  ep_fem_force(&f.b.fem, u, force);
  sum_forces(&f, &(ep_pose){q, NULL, NULL}, sum);
  double full[R];
  for (int a = 0; a < R; a++) {
    full[a] = 0;
    for (size_t i = 0; i < f.b.n3; i++) full[a] += f.basis.u[(size_t)a * f.b.n3 + i] * force[i];
  }
  ASSERT_LESS(distance_of(R, sum, full), 1e-11 * norm_of(R, full)); // 432 elements of round-off
  free(u);
  free(force);
  free_fixture(&f);
}

// sum V |det F_i| psi(F F_i^-1), straight from the definition.
static double relative_energy(const fixture *f, const double *q, const double *reference) {
  double sum = 0;
  for (int e = 0; e < f->elements.nt; e++) {
    double now[9], base[9], inverse[9], relative[9];
    ep_element_gradient(&f->elements, e, q, now);
    const double det = ep_element_gradient(&f->elements, e, reference, base);
    // rows of the inverse by cross products of columns
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) {
        const int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
        inverse[3 * i + j] =
            (base[3 * a + c] * base[3 * b + d] - base[3 * a + d] * base[3 * b + c]) / det;
      }
    for (int i = 0; i < 9; i++) {
      relative[i] = 0;
      for (int k = 0; k < 3; k++) relative[i] += now[i / 3 * 3 + k] * inverse[3 * k + i % 3];
    }
    sum += f->b.fem.volume[e] * det *
           ep_material_energy(f->b.fem.model, f->b.fem.lambda[e], f->b.fem.mu[e], relative);
  }
  return sum;
}

static double gradient_error(const fixture *f, const double *q, const double *reference,
                             const double *direction, double h) {
  double plus[R], minus[R], force[R], slope = 0;
  for (int a = 0; a < R; a++) {
    plus[a] = q[a] + h * direction[a];
    minus[a] = q[a] - h * direction[a];
  }
  sum_forces(f, &(ep_pose){q, reference, NULL}, force);
  for (int a = 0; a < R; a++) slope += force[a] * direction[a];
  const double difference =
      (relative_energy(f, plus, reference) - relative_energy(f, minus, reference)) / (2 * h);
  return fabs(difference - slope) / fabs(slope);
}

static void test_relative_forces(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, EXAMPLES, NULL);
  double q[R], direction[R], force[R], rest[R];
  for (int i = 0; i < EXAMPLES; i++) {
    const double *reference = f.basis.example_q + i * R;
    random_q(&f, 5, 40, q);
    random_q(&f, 6, 40, direction);
    for (int a = 0; a < R; a++) q[a] += reference[a];
    const double coarse = gradient_error(&f, q, reference, direction, 0.1);
    const double fine = gradient_error(&f, q, reference, direction, 0.05);
    ASSERT_NEAR(order_of(coarse, fine), 2, 0.1); // central differences
    ASSERT_LESS(fine, 0.05);
    sum_forces(&f, &(ep_pose){reference, reference, NULL}, force);
    memset(q, 0, sizeof q);
    sum_forces(&f, &(ep_pose){q, reference, NULL}, rest); // at rest the example pulls
    ASSERT_LESS(norm_of(R, force), 1e-10 * norm_of(R, rest));
  }
  free_fixture(&f);
}

// |E(q) - w E(q_i)|^2_D.
static double strain_distance(const fixture *f, const double *q, const double *target, double w) {
  double sum = 0;
  for (int e = 0; e < f->elements.nt; e++) {
    double now[9], then[9], strain[9], trace = 0, squared = 0;
    ep_element_gradient(&f->elements, e, q, now);
    ep_element_gradient(&f->elements, e, target, then);
    for (int i = 0; i < 9; i++) {
      strain[i] = i % 4 ? 0 : -0.5 * (1 - w);
      for (int k = 0; k < 3; k++)
        strain[i] += 0.5 * (now[3 * k + i / 3] * now[3 * k + i % 3] -
                            w * then[3 * k + i / 3] * then[3 * k + i % 3]);
      squared += strain[i] * strain[i];
      trace += i % 4 ? 0 : strain[i];
    }
    sum +=
        f->b.fem.volume[e] * (f->b.fem.mu[e] * squared + 0.5 * f->b.fem.lambda[e] * trace * trace);
  }
  return sum;
}

static void test_paths(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, EXAMPLES, NULL);
  double paths[EXAMPLES * EP_PATH_STATIONS * R], q[R], step[R];
  ASSERT_OK(ep_example_paths(&f.elements, &f.basis, paths, err));
  for (int i = 0; i < EXAMPLES; i++) {
    const double *target = f.basis.example_q + i * R;
    for (int s = 0; s < EP_PATH_STATIONS; s++) {
      const double *station = paths + (i * EP_PATH_STATIONS + s) * R;
      const double w = (s + 1.0) / EP_PATH_STATIONS;
      const double value = strain_distance(&f, station, target, w);
      for (int a = 0; a < R; a++) q[a] = w * target[a];
      if (s + 1 < EP_PATH_STATIONS) ASSERT_LESS(value, strain_distance(&f, q, target, w));
      for (uint64_t trial = 0; trial < 10; trial++) { // a minimum: every way out goes up
        random_q(&f, 20 + trial, 20, step);
        for (int a = 0; a < R; a++) q[a] = station[a] + step[a];
        ASSERT_LESS(value, strain_distance(&f, q, target, w));
      }
    }
    assert_memory_equal(paths + (i * EP_PATH_STATIONS + 3) * R, target, R * sizeof(double));
  }
  free_fixture(&f);
}

static double largest_displacement(const fixture *f, const double *q) {
  double largest = 0;
  for (size_t v = 0; v < (size_t)f->b.mesh.nv; v++) {
    double u[3] = {0};
    for (size_t a = 0; a < R; a++)
      for (size_t i = 0; i < 3; i++) u[i] += q[a] * f->basis.u[a * f->b.n3 + 3 * v + i];
    largest = fmax(largest, norm_of(3, u));
  }
  return largest;
}

static void test_poses(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, EXAMPLES, NULL);
  double paths[EXAMPLES * EP_PATH_STATIONS * R], largest = 0, mean = 0;
  ASSERT_OK(ep_example_paths(&f.elements, &f.basis, paths, err));
  ep_pose_set poses, again, held;
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, paths,
                          &(ep_cubature_options){.amplitude = 0.2, .seed = 3}, 160, 1, &poses,
                          err));
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, paths,
                          &(ep_cubature_options){.amplitude = 0.2, .seed = 3}, 160, 1, &again,
                          err));
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, paths,
                          &(ep_cubature_options){.amplitude = 0.2, .seed = 3}, 160, 2, &held, err));
  const double reach = 0.2 * ep_mesh_diagonal(&f.b.mesh);
  int kinds[EP_POSE_KINDS] = {0};
  for (int p = 0; p < poses.count; p++) {
    const ep_pose pose = ep_pose_at(&poses, p);
    kinds[poses.kind[p]]++;
    int crushed = 0;
    for (int e = 0; e < f.elements.nt; e++)
      crushed += ep_element_volume_ratio(&f.elements, e, &pose) < 0.1;
    assert_true(crushed <= f.elements.nt / 100);
    if (poses.kind[p] != EP_POSE_RANDOM) continue;
    const double size = largest_displacement(&f, pose.q) / reach;
    largest = fmax(largest, size);
    mean += size / 80;
  }
  assert_true(kinds[0] == 80 && kinds[1] == 20 && kinds[2] == 60);
  assert_in_range((int)(1000 * largest), 900, 1000); // uniform up to the reach
  assert_in_range((int)(1000 * mean), 350, 600);     // some were made smaller; 80 draws: sigma .03
  assert_memory_equal(poses.q, again.q, 160 * R * sizeof(double));
  assert_memory_not_equal(poses.q, held.q, 160 * R * sizeof(double));
  ep_poses_free(&poses);
  ep_poses_free(&again);
  ep_poses_free(&held);
  free_fixture(&f);
}

// An amplitude that turns elements over everywhere: poses are made smaller, none is crushed.
static void test_shrinks(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, 0, NULL);
  ep_pose_set poses;
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, NULL,
                          &(ep_cubature_options){.amplitude = 50, .seed = 3}, 20, 1, &poses, err));
  assert_in_range(poses.shrunk, 10, 20);
  for (int p = 0; p < poses.count; p++) {
    const ep_pose pose = ep_pose_at(&poses, p);
    int crushed = 0;
    for (int e = 0; e < f.elements.nt; e++)
      crushed += !(ep_element_volume_ratio(&f.elements, e, &pose) >= 0.1);
    assert_true(crushed <= f.elements.nt / 100);
    ASSERT_LESS(1e-3, largest_displacement(&f, pose.q));
  }
  ep_poses_free(&poses);
  free_fixture(&f);
}

static void test_error_measure(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, EXAMPLES, NULL);
  double paths[EXAMPLES * EP_PATH_STATIONS * R], error;
  ASSERT_OK(ep_example_paths(&f.elements, &f.basis, paths, err));
  ep_pose_set poses;
  ep_training training;
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, paths,
                          &(ep_cubature_options){.amplitude = 0.2, .seed = 3}, 24, 1, &poses, err));
  ASSERT_OK(ep_training_make(&f.elements, &poses, &training, err));
  int *tet = malloc((size_t)f.elements.nt * sizeof *tet);
  double *weight = vector_of((size_t)f.elements.nt);
  for (int e = 0; e < f.elements.nt; e++) tet[e] = e;
  ASSERT_OK(ep_training_error(&training, f.elements.nt, tet, f.b.fem.volume, &error, err));
  ASSERT_LESS(error, 1e-12);
  ASSERT_OK(ep_training_error(&training, 0, NULL, NULL, &error, err));
  ASSERT_NEAR(error, 1, 1e-14);
  for (int e = 0; e < f.elements.nt; e++) weight[e] = 1.25 * f.b.fem.volume[e];
  ASSERT_OK(ep_training_error(&training, f.elements.nt, tet, weight, &error, err));
  ASSERT_NEAR(error, 0.25, 1e-12);
  free(tet);
  free(weight);
  ep_training_free(&training);
  ep_poses_free(&poses);
  free_fixture(&f);
}

// Elements chosen in a sketch of a sixth of the equations are nearly as good, after the exact
// refit.
static void test_sketch(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, 0, NULL);
  ep_pose_set poses;
  ep_training training;
  ASSERT_OK(ep_poses_make(&f.elements, &f.basis, NULL,
                          &(ep_cubature_options){.amplitude = 0.2, .seed = 3}, 150, 1, &poses,
                          err));
  ASSERT_OK(ep_training_make(&f.elements, &poses, &training, err));
  double error[2];
  for (int sketched = 0; sketched < 2; sketched++) {
    ep_gram gram;
    ep_passive set;
    ep_random rng = ep_random_seed(1, 1);
    double weight[30];
    ASSERT_OK(ep_gram_create(f.elements.nt, sketched ? 300 : 150 * R, &gram, err));
    ASSERT_OK(ep_training_system(&training, &rng, &gram, err));
    ASSERT_OK(ep_gram_prepare(&gram, err));
    ASSERT_OK(ep_passive_create(30, &set, err));
    ASSERT_OK(ep_select_grow(&gram, &(ep_growth){.shortlist = 64}, 30, &set, err));
    ASSERT_OK(ep_training_refit(&training, set.count, set.index, weight, err));
    ASSERT_OK(ep_training_error(&training, set.count, set.index, weight, &error[sketched], err));
    if (!sketched) // one system, two ways to its residual
      ASSERT_NEAR(error[0], sqrt(ep_selection_residual(&gram, &set)), 1e-9);
    ep_passive_free(&set);
    ep_gram_free(&gram);
  }
  ASSERT_LESS(error[1], 1.3 * error[0]); // embedding error ~ sqrt(30 / 300)
  assert_true(error[0] != error[1]);
  ep_training_free(&training);
  ep_poses_free(&poses);
  free_fixture(&f);
}

static void same(const ep_cubature *a, const ep_cubature *b) {
  assert_int_equal(a->count, b->count);
  assert_memory_equal(a->tet, b->tet, (size_t)a->count * sizeof *a->tet);
  assert_memory_equal(a->weight, b->weight, (size_t)a->count * sizeof *a->weight);
  assert_true(a->held_out_error == b->held_out_error && a->train_error == b->train_error);
}

static void test_train(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, EXAMPLES, NULL);
  const int sizes[4] = {8, 20, 30, 45};
  ep_cubature_options o = ep_default_cubature_options();
  o.elements = 30;
  o.poses = 64;
  ep_cubature plain, curve, pool;
  ASSERT_OK(ep_cubature_train(&f.b.fem, &f.basis, &o, NULL, &plain, err));
  assert_in_range(plain.count, 25, 30);
  for (int j = 0; j < plain.count; j++) {
    assert_true(plain.weight[j] > 0);
    assert_in_range(plain.tet[j], j ? plain.tet[j - 1] + 1 : 0, f.elements.nt - 1);
  }
  ASSERT_LESS(plain.held_out_error, 0.1);
  ASSERT_LESS(plain.train_error, plain.held_out_error * 1.1);
  o.curve_count = 4;
  o.curve_size = sizes;
  ASSERT_OK(ep_cubature_train(&f.b.fem, &f.basis, &o, NULL, &curve, err));
  same(&plain, &curve);
  assert_true(curve.curve[2] == curve.held_out_error);
  for (int i = 1; i < 4; i++) ASSERT_LESS(curve.curve[i], curve.curve[i - 1]);
  o.curve_count = 0;
  o.method = 1;
  ASSERT_OK(ep_cubature_train(&f.b.fem, &f.basis, &o, NULL, &pool, err));
  ASSERT_LESS(plain.train_error, pool.train_error);
  o.method = 0;
  o.tolerance = 0.2; // reached by a few
  ep_cubature few;
  ASSERT_OK(ep_cubature_train(&f.b.fem, &f.basis, &o, NULL, &few, err));
  ASSERT_LESS(few.train_error, 0.2);
  assert_in_range(few.count, 1, 20);
  ep_cubature_free(&plain);
  ep_cubature_free(&curve);
  ep_cubature_free(&pool);
  ep_cubature_free(&few);
  free_fixture(&f);
}

// An example with a vertex pushed through its tets: they count for nothing in poses relative to it,
// and it is said.
static void test_inverted_example(void **state) {
  (void)state;
  bar b;
  make_bar(&b, (int[3]){8, 3, 3}, (double[3]){4, 1, 1}, EP_STVK_VOLUME,
           (ep_elastic){1000, 1e5, 0.4}, 1);
  double *poses = vector_of(2 * b.n3);
  bend_and_twist(&b, poses);
  poses[b.n3 - 3] -= 0.9; // the last vertex, a far corner
  free_bar(&b);
  fixture f;
  make_fixture(&f, 1, poses);
  free(poses);
  ep_cubature_options o = ep_default_cubature_options();
  o.elements = 30;
  o.poses = 32;
  ep_log log = {.quiet = true};
  ep_cubature c;
  ASSERT_OK(ep_cubature_train(&f.b.fem, &f.basis, &o, &log, &c, err));
  assert_int_equal(log.warnings, 1);
  // .0078 when this was written: the ruined elements do not spoil the others' forces.
  ASSERT_LESS(c.held_out_error, 0.02);
  ep_cubature_free(&c);
  free_fixture(&f);
}

static void refuse(const fixture *f, ep_cubature_options o, const char *word) {
  ep_error err = {0};
  ep_cubature c;
  assert_int_equal(ep_cubature_train(&f->b.fem, &f->basis, &o, NULL, &c, &err), EP_ERR_ARGUMENT);
  if (!strstr(err.text, word)) fail_msg("no \"%s\" in \"%s\"", word, err.text);
  assert_null(c.tet);
}

static void test_refuses(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, 0, NULL);
  ep_cubature_options o = ep_default_cubature_options();
  o.elements = 0;
  refuse(&f, o, "elements");
  o = ep_default_cubature_options();
  o.amplitude = NAN;
  refuse(&f, o, "amplitude");
  o = ep_default_cubature_options();
  o.method = 2;
  refuse(&f, o, "method 2");
  o = ep_default_cubature_options();
  o.curve_count = 2;
  o.curve_size = (int[2]){5, 5};
  refuse(&f, o, "ascending");
  free_fixture(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_forces_add_up),
      cmocka_unit_test(test_relative_forces),
      cmocka_unit_test(test_paths),
      cmocka_unit_test(test_poses),
      cmocka_unit_test(test_shrinks),
      cmocka_unit_test(test_error_measure),
      cmocka_unit_test(test_sketch),
      cmocka_unit_test(test_train),
      cmocka_unit_test(test_inverted_example),
      cmocka_unit_test(test_refuses),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
