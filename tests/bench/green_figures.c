// Figures 3 and 4 of Zhang et al. 2015 on a cuboid of our own. Usage: green_figures [FOLDER]
// Figure 3 (drift and resistance): the cuboid interpolated between rest and a twist of 120 degrees,
// x(w) = argmin |E(x) - w E(P)|: energies W_StVK and W_E = W_StVK + W_a along w, and their
// generalised forces dW/dw. With FOLDER: drift.csv and drift.png. Figure 4 (basis): equilibrium
// under a load in full space and in bases of r modes with and without the example; error = |u_r -
// u|_max / diagonal of the rest shape.
#include "tests/bake/bar.h"

#include <stdio.h>

#include "linalg/petsc.h"
#include "reduced/bake/green_full.h"
#include "reduced/bake/model_build.h"
#include "results/chart.h"
#include "results/csv.h"

enum { SAMPLES = 20 };
static const double SIZE[3] = {1, 0.25, 0.25};

static void make(bar *b, double *pose) {
  const int cells[3] = {16, 4, 4};
  const ep_elastic rubber = {.density = 1000, .young = 2e5, .poisson = 0.35};
  make_bar(b, cells, SIZE, EP_STVK, rubber, 1);
  for (int v = 0; v < b->mesh.nv; v++) {
    const double *x = b->mesh.x + 3 * v, t = x[0] * x[0] * (3 - 2 * x[0]); // level at both ends
    const double a = t * 120 * acos(-1) / 180, y = x[1] - 0.125, z = x[2] - 0.125;
    pose[3 * v] = 0;
    pose[3 * v + 1] = cos(a) * y - sin(a) * z - y;
    pose[3 * v + 2] = sin(a) * y + cos(a) * z - z;
  }
}

// ---- figure 3 ----------------------------------------------------------------------------------

static void drift(const bar *b, const double *pose, const char *folder) {
  ep_green_full full;
  double *path = vector_of(SAMPLES * b->n3), y[1], w[1];
  double omega[SAMPLES + 1], table[SAMPLES + 1][4], fit[SAMPLES + 1];
  ASSERT_OK(ep_green_full_create(&b->fem, b->fem.volume, 1, pose, NULL, NULL, &full, err));
  ASSERT_OK(ep_path_samples(&b->fem, pose, SAMPLES, NULL, path, err));
  for (int i = 0; i <= SAMPLES; i++) {
    omega[i] = (double)i / SAMPLES;
    fit[i] = table[i][0] = table[i][1] = 0;
    if (i == 0) continue;
    const double *u = path + (size_t)(i - 1) * b->n3;
    table[i][0] = ep_fem_energy(&b->fem, u);
    table[i][1] = table[i][0] + ep_green_full_energy(&full, u, y, NULL, w);
    fit[i] = w[0];
  }
  for (int i = 0; i <= SAMPLES; i++)
    for (int c = 0; c < 2; c++) {
      const int low = i ? i - 1 : 0, high = i < SAMPLES ? i + 1 : i;
      table[i][2 + c] = (table[high][c] - table[low][c]) / (omega[high] - omega[low]);
    }
  printf("figure 3: twisted cuboid, %d tets; energies [J] and generalised forces dW/dw [J]\n",
         b->mesh.nt);
  printf("%6s %8s %10s %10s %10s %10s\n", "w", "found w", "W_StVK", "W_E", "dW_StVK/dw", "dW_E/dw");
  double largest[4] = {0};
  for (int i = 0; i <= SAMPLES; i++) {
    printf("%6.2f %8.4f %10.4g %10.4g %10.4g %10.4g\n", omega[i], fit[i], table[i][0], table[i][1],
           table[i][2], table[i][3]);
    for (int c = 0; c < 4; c++) largest[c] = fmax(largest[c], fabs(table[i][c]));
  }
  printf("largest W_E / W_StVK %.3g, largest force ratio %.3g\n", largest[1] / largest[0],
         largest[3] / largest[2]);
  if (folder) {
    char name[4096];
    const char *const names[] = {"W_StVK", "W_E", "dW_StVK/dw", "dW_E/dw"};
    const ep_csv_group groups[] = {{"w", 1, omega, false}, {"value", 4, table[0], true}};
    snprintf(name, sizeof name, "%s/drift.csv", folder);
    ASSERT_OK(ep_csv_write(name, SAMPLES + 1, 2, groups, err));
    double column[4][SAMPLES + 1];
    ep_chart_series line[4];
    for (int c = 0; c < 4; c++) {
      for (int i = 0; i <= SAMPLES; i++) column[c][i] = table[i][c];
      line[c] = (ep_chart_series){
          .name = names[c], .n = SAMPLES + 1, .x = omega, .y = column[c], .line = true, .color = c};
    }
    const ep_chart chart = {.title = "drift and resistance: rest to a twist of 120 degrees",
                            .x_label = "w",
                            .y_label = "J",
                            .width = 800,
                            .height = 480,
                            .series = 4,
                            .list = line};
    snprintf(name, sizeof name, "%s/drift.png", folder);
    ASSERT_OK(ep_chart_write_png(name, &chart, err));
  }
  ep_green_full_free(&full);
  free(path);
}

// ---- figure 4 ----------------------------------------------------------------------------------

// Equilibrium in a basis: implicit Euler with a step so long that inertia vanishes.
static double reduced_error(const bar *b, const double *pose, const double *load, double alpha,
                            const double *truth, const ep_modes *modes, const double *path,
                            int samples, int r) {
  ep_basis basis;
  ep_green_coefficients green;
  ep_model_memory memory;
  const int with = samples > 0;
  ASSERT_OK(ep_basis_build(&b->fem, modes, with, pose, samples, path, r, NULL, &basis, err));
  if (!with) { // the example acts all the same
    basis.examples = 1;
    basis.example_q = vector_of((size_t)r);
  }
  ASSERT_OK(
      ep_green_coefficients_compute(&b->fem, &basis, pose, b->fem.volume, NULL, NULL, &green, err));
  int *all = malloc((size_t)b->mesh.nt * sizeof *all);
  assert_non_null(all);
  for (int e = 0; e < b->mesh.nt; e++) all[e] = e;
  const ep_model_parts parts = {.fem = &b->fem,
                                .basis = &basis,
                                .s = b->mesh.nt,
                                .tet = all,
                                .weight = b->fem.volume,
                                .green = &green};
  ASSERT_OK(ep_model_build(&parts, &memory, err));
  const size_t bytes = (ep_state_bytes(&memory.model) + 63) / 64 * 64;
  void *block = aligned_alloc(64, bytes);
  ep_state *state;
  assert_int_equal(ep_state_init(&memory.model, block, bytes, &state), EP_OK);
  double *force = vector_of((size_t)r), *x = vector_of(b->n3), error = 0;
  ep_step_def def = ep_default_step();
  def.dt = 1e3;
  def.green.alpha = alpha;
  def.force = force;
  def.max_iterations = 300;
  for (int part = 1; part <= 4; part++) {
    for (size_t a = 0; a < (size_t)r; a++) {
      force[a] = 0;
      for (size_t i = 0; i < b->n3; i++) force[a] += 0.25 * part * load[i] * basis.u[a * b->n3 + i];
      ep_state_velocity(state)[a] = 0;
    }
    assert_int_equal(ep_step(state, &def, NULL), EP_OK);
  }
  ep_positions(&memory.model, ep_state_q(state), x);
  for (size_t i = 0; i < b->n3; i++) error = fmax(error, fabs(x[i] - b->mesh.x[i] - truth[i]));
  free(force), free(x), free(block), free(all);
  ep_model_memory_free(&memory);
  ep_green_coefficients_free(&green);
  ep_basis_free(&basis);
  return error / norm_of(3, SIZE);
}

static void bases(const bar *b, const double *pose) {
  static const int without[] = {10, 20, 40}, with[] = {10, 20, 40};
  ep_green_full full;
  ep_modes modes;
  double *path = vector_of(4 * b->n3), *load = vector_of(b->n3), *u = vector_of(b->n3);
  const double alpha = 0.9;
  ASSERT_OK(ep_green_full_create(&b->fem, b->fem.volume, 1, pose, NULL, NULL, &full, err));
  ASSERT_OK(ep_path_samples(&b->fem, pose, 4, NULL, path, err));
  ASSERT_OK(ep_modes_compute(&b->fem, 15, NULL, &modes, err));
  int ends = 0;
  for (int v = 0; v < b->mesh.nv; v++) ends += b->mesh.x[3 * v] > 0.999;
  for (int v = 0; v < b->mesh.nv; v++) { // a couple of 16 N over the end face
    if (b->mesh.x[3 * v] < 0.999) continue;
    const double y = b->mesh.x[3 * v + 1] - 0.125, z = b->mesh.x[3 * v + 2] - 0.125;
    load[3 * v + 1] = -16 * z / 0.125 * 8 / ends;
    load[3 * v + 2] = 16 * y / 0.125 * 8 / ends;
  }
  ep_green_full_report report;
  for (int part = 1; part <= 4; part++) {
    double *now = vector_of(b->n3);
    for (size_t i = 0; i < b->n3; i++) now[i] = 0.25 * part * load[i];
    ASSERT_OK(ep_green_full_equilibrium(&full, alpha, now, u, &report, err));
    free(now);
  }
  double y[1], w[1];
  ep_green_full_energy(&full, u, y, NULL, w);
  printf("figure 4: torque at the end, alpha = %.1f, full space: weight %.3f, residual %.1e\n",
         alpha, w[0], report.residual);
  for (size_t i = 0; i < 3; i++)
    printf("%3d modes without example: error %.5f of the diagonal\n", without[i],
           reduced_error(b, pose, load, alpha, u, &modes, NULL, 0, without[i]));
  for (size_t i = 0; i < 3; i++)
    printf("%3d modes with example:    error %.5f of the diagonal\n", with[i],
           reduced_error(b, pose, load, alpha, u, &modes, path, 4, with[i]));
  ep_modes_free(&modes);
  ep_green_full_free(&full);
  free(path), free(load), free(u);
}

int main(int argc, char **argv) {
  ep_error err = {0};
  bar b;
  if (ep_petsc_start(&err) != EP_OK) return fprintf(stderr, "%s\n", err.text), 1;
  double *pose = vector_of(3 * 17 * 5 * 5);
  make(&b, pose);
  drift(&b, pose, argc > 1 ? argv[1] : NULL);
  bases(&b, pose);
  free_bar(&b);
  free(pose);
  ep_petsc_stop();
  return 0;
}
