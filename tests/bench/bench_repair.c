// Repair of inverted and crushed tets of transferred poses, two ways in one table: the one in use
// (lbspace/pose_repair.c: least change of the deformation gradients under J >= target) against
// Newton steps on stable neo-Hookean energy of the whole object with the low coefficients held. The
// poses are made as the bake makes them, with nothing held. Not a test: it prints a table.
// bench_repair [word]: only poses whose name contains the word.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "linalg/dense.h"
#include "linalg/petsc.h"
#include "reduced/bake/fem.h"
#include "tests/align/shapes.h"

#define DATA   EP_SOURCE_DIR "/data/meshes"
#define SHARED EP_SOURCE_DIR "/../shared/data"

typedef struct sample {
  const char *name, *folder, *object, *rest, *pose;
  int m;
  double times; // what the example does, exaggerated: mild poses invert nothing
} sample;

#define POSE_OF_CAR     SHARED "/car", "car.veg", "ex0.veg", "ex1.veg"
#define POSE_OF_GORILLA SHARED "/gorilla", "gorilla.veg", "ex0.veg", "ex1.veg"
#define POSE_OF_LETTER  SHARED "/letter-c", "C.veg", "ex0.veg", "ex1.veg"
static const sample SAMPLES[] = {
    {"car ex1", POSE_OF_CAR, 6, 1},
    {"car ex1", POSE_OF_CAR, 10, 1},
    {"car ex1", POSE_OF_CAR, 20, 1.5},
    {"gorilla ex1", POSE_OF_GORILLA, 10, 1.5},
    {"gorilla ex1", POSE_OF_GORILLA, 20, 2},
    {"letter-c ex1", POSE_OF_LETTER, 10, 3},
    {"letter-c ex1", POSE_OF_LETTER, 20, 2},
    {"plane <- bird raised", DATA, "plane.msh", "bird.veg", "bird-raised-own.veg", 20, 6},
    {"plane <- fish swimming", DATA, "plane.msh", "fish.veg", "fish-swim-own.veg", 20, 4},
    {"car <- estate S", DATA, "car.msh", "estate.veg", "estate-s.veg", 20, 3},
    {"teddy <- slim jumping", DATA, "teddy.msh", "slim.veg", "slim-jump.veg", 20, 3},
    {"cross <- round, side", DATA, "cross.msh", "round.veg", "round-side.veg", 20, 3},
    {"bar <- cylinder S", DATA, "bar.msh", "cylinder.veg", "cylinder-s.veg", 20, 2},
};

static void need(ep_status status, const ep_error *err) {
  if (status != EP_OK) fail_msg("%s", err->text);
}

static double *numbers(size_t count) {
  double *x = calloc(count ? count : 1, sizeof *x);
  assert_non_null(x);
  return x;
}

// ---- the pose ----------------------------------------------------------------------------------

// Displacement of the pose against rest as the object's vertices see it, in the object's frame.
static void see(const ep_map *to_rest, const ep_map *to_pose, const ep_mesh *rest,
                const ep_mesh *pose, double *u) {
  const size_t n = (size_t)rest->nv;
  double *moved = numbers(3 * n), *weight = numbers(n), r[9], a[3], b[3];
  ep_error err = {0};
  ep_mesh_vertex_volumes(rest, weight);
  ep_map_pull(to_pose, pose, 3, pose->x, moved);
  need(ep_kabsch(rest->nv, moved, rest->x, weight, r, a, b, &err), &err);
  for (size_t v = 0; v < n; v++) {
    double d[3], y[3];
    for (int c = 0; c < 3; c++) d[c] = moved[3 * v + (size_t)c] - a[c];
    for (int c = 0; c < 3; c++) {
      y[c] = r[3 * c] * d[0] + r[3 * c + 1] * d[1] + r[3 * c + 2] * d[2];
      moved[3 * v + (size_t)c] = y[c] + b[c] - rest->x[3 * v + (size_t)c];
    }
  }
  ep_map_pull(to_rest, rest, 3, moved, u);
  const double *q = to_rest->rotation;
  for (size_t v = 0; v < (size_t)to_rest->n; v++) {
    const double d[3] = {u[3 * v], u[3 * v + 1], u[3 * v + 2]};
    for (size_t c = 0; c < 3; c++)
      u[3 * v + c] = to_rest->scale * (q[3 * c] * d[0] + q[3 * c + 1] * d[1] + q[3 * c + 2] * d[2]);
  }
  free(moved);
  free(weight);
}

static void make_pose(const sample *s, test_shape shape[3], double **u) {
  const char *file[3] = {s->object, s->rest, s->pose};
  ep_map map[2];
  ep_error err = {0};
  ep_map_options o = ep_default_map_options();
  ep_pose_options po = ep_default_pose_options();
  for (int i = 0; i < 3; i++) shape_from_file(&shape[i], s->folder, file[i], 40);
  for (int i = 0; i < 2; i++) {
    o.m = s->m;
    o.same_family = i == 1;
    o.keep_frame = true;
    need(ep_map_match(&shape[i].shape, &shape[i + 1].shape, &o, NULL, &map[i], &err), &err);
  }
  *u = numbers(3 * (size_t)shape[0].mesh.nv);
  double *d = numbers(3 * (size_t)s->m);
  see(&map[0], &map[1], &shape[1].mesh, &shape[2].mesh, *u);
  ep_lb low = shape[0].lb;
  low.m = po.m = s->m;
  ep_lb_project(&low, &shape[0].mass, *u, d);
  for (int i = 0; i < 3 * s->m; i++) d[i] *= s->times;
  need(ep_lb_pose(&shape[0].mesh, &low, d, &po, *u, NULL, &err), &err);
  free(d);
  for (int i = 0; i < 2; i++) ep_map_free(&map[i]);
}

// ---- Newton on stable neo-Hookean energy -------------------------------------------------------

typedef struct hooke {
  ep_fem fem;
  ep_csr stiffness;
  ep_factor *factor;
  int rows, n3;                 // held combinations; unknowns
  double *low;                  // (rows x n3) mass times (constant, first m functions), each axis
  double *inverse;              // (rows x n3) K^-1 low^T, row by row
  double *force, *step, *trial; // (n3)
  double *schur, *rhs, *answer; // (rows x rows), (rows), (rows)
} hooke;

// Rows low: M (1, phi_1 .. phi_m), for x, y and z.
static void hold_low(hooke *h, const test_shape *s, int m) {
  const int n = s->mesh.nv;
  double *f = numbers((size_t)n), *mf = numbers((size_t)n);
  h->rows = 3 * (m + 1);
  h->low = numbers((size_t)h->rows * (size_t)h->n3);
  for (int j = 0; j <= m; j++) {
    for (int i = 0; i < n; i++)
      f[i] = j ? s->lb.phi[(size_t)(j - 1) * (size_t)n + (size_t)i] : 1 / sqrt(s->lb.volume);
    ep_csr_multiply(&s->mass, 1, f, mf);
    for (int c = 0; c < 3; c++)
      for (int i = 0; i < n; i++)
        h->low[(size_t)(3 * j + c) * (size_t)h->n3 + 3 * (size_t)i + (size_t)c] = mf[i];
  }
  free(f);
  free(mf);
}

static void make_hooke(hooke *h, const test_shape *s, int m, double poisson) {
  ep_error err = {0};
  const ep_elastic material = {.density = 1, .young = 1, .poisson = poisson};
  memset(h, 0, sizeof *h);
  h->n3 = 3 * s->mesh.nv;
  need(ep_fem_create(&s->mesh, EP_STABLE_NEOHOOKEAN, 1, &material, 0, NULL, &h->fem, &err), &err);
  need(ep_csr_from_tets(s->mesh.nv, s->mesh.nt, s->mesh.tet, 3, &h->stiffness, &err), &err);
  hold_low(h, s, m);
  const size_t rows = (size_t)h->rows, n3 = (size_t)h->n3;
  h->inverse = numbers(rows * n3);
  h->force = numbers(n3);
  h->step = numbers(n3);
  h->trial = numbers(n3);
  h->schur = numbers(rows * rows);
  h->rhs = numbers(2 * rows);
  h->answer = h->rhs + rows;
}

static void free_hooke(hooke *h) {
  ep_fem_free(&h->fem);
  ep_csr_free(&h->stiffness);
  ep_factor_free(h->factor);
  free(h->low);
  free(h->inverse);
  free(h->force);
  free(h->step);
  free(h->trial);
  free(h->schur);
  free(h->rhs);
}

// The projected stiffness, made definite on rigid motions: those are held by the rows anyway.
static void factor(hooke *h, const double *u) {
  ep_error err = {0};
  double trace = 0;
  ep_fem_stiffness(&h->fem, u, 1, &h->stiffness);
  for (int i = 0; i < h->n3; i++) trace += h->stiffness.value[ep_csr_find(&h->stiffness, i, i)];
  for (int i = 0; i < h->n3; i++)
    h->stiffness.value[ep_csr_find(&h->stiffness, i, i)] += 1e-6 * trace / h->n3;
  need(h->factor ? ep_factor_update(h->factor, &h->stiffness, &err)
                 : ep_factor_create(&h->stiffness, NULL, 1, &h->factor, &err),
       &err);
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// step: K step = -force + low^T y with low step = 0.
static void find_step(hooke *h) {
  ep_error err = {0};
  const size_t n3 = (size_t)h->n3;
  for (int i = 0; i < h->n3; i++) h->trial[i] = -h->force[i];
  need(ep_factor_solve(h->factor, 1, h->trial, h->step, &err), &err);
  for (int a = 0; a < h->rows; a++) {
    need(ep_factor_solve(h->factor, 1, h->low + (size_t)a * n3, h->inverse + (size_t)a * n3, &err),
         &err);
    h->rhs[a] = dot(h->n3, h->low + (size_t)a * n3, h->step);
  }
  for (int a = 0; a < h->rows; a++)
    for (int b = 0; b < h->rows; b++)
      h->schur[a * h->rows + b] = dot(h->n3, h->low + (size_t)a * n3, h->inverse + (size_t)b * n3);
  need(ep_solve_spd(h->rows, h->schur, 1, h->rhs, &err), &err);
  for (int a = 0; a < h->rows; a++)
    for (size_t i = 0; i < n3; i++) h->step[i] -= h->rhs[a] * h->inverse[(size_t)a * n3 + i];
}

static void count_tets(const ep_mesh *mesh, const double *u, int *inverted, int *crushed,
                       double *worst) {
  const size_t nt = (size_t)mesh->nt;
  double *x = numbers(3 * (size_t)mesh->nv), *volume = numbers(2 * nt);
  for (int i = 0; i < 3 * mesh->nv; i++) x[i] = mesh->x[i] + u[i];
  ep_tet_volumes(mesh, mesh->x, volume);
  ep_tet_volumes(mesh, x, volume + nt);
  *inverted = *crushed = 0;
  *worst = INFINITY;
  for (size_t e = 0; e < nt; e++) {
    const double ratio = volume[nt + e] / volume[e];
    *inverted += !(ratio > 0);
    *crushed += !(ratio >= ep_default_repair_options().floor);
    *worst = fmin(*worst, ratio);
  }
  free(x);
  free(volume);
}

// Newton until no tet is crushed, at most `most` steps. Returns the number of steps.
static int newton(hooke *h, int most, double *u) {
  int inverted, crushed, done = 0;
  double worst;
  for (; done < most; done++) {
    count_tets(h->fem.mesh, u, &inverted, &crushed, &worst);
    if (!crushed) break;
    const double before = ep_fem_energy(&h->fem, u);
    ep_fem_force(&h->fem, u, h->force);
    factor(h, u);
    find_step(h);
    double length = 1, after = before;
    for (int i = 0; i < 20; i++, length /= 2) {
      for (int k = 0; k < h->n3; k++) h->trial[k] = u[k] + length * h->step[k];
      after = ep_fem_energy(&h->fem, h->trial);
      if (after < before) break;
    }
    if (!(after < before)) break;
    memcpy(u, h->trial, (size_t)h->n3 * sizeof *u);
    if (1 - after / before < 1e-8) return done + 1; // settled
  }
  return done;
}

// ---- the table ---------------------------------------------------------------------------------

static void print_row(const char *how, const ep_mesh *mesh, const double *given, const double *u,
                      int steps, double seconds) {
  int inverted, crushed;
  double worst, sum = 0, pose = 0, volume = 0, most = 0;
  double *weight = numbers((size_t)mesh->nv);
  count_tets(mesh, u, &inverted, &crushed, &worst);
  ep_mesh_vertex_volumes(mesh, weight);
  for (int i = 0; i < mesh->nv; i++) {
    double d2 = 0, p2 = 0;
    for (int c = 0; c < 3; c++) {
      d2 += pow(u[3 * i + c] - given[3 * i + c], 2);
      p2 += pow(given[3 * i + c], 2);
    }
    sum += weight[i] * d2;
    pose += weight[i] * p2;
    volume += weight[i];
    most = fmax(most, d2);
  }
  const double diagonal = ep_mesh_diagonal(mesh);
  printf("  %-26s %5d %5d %8.3f  %8.5f %8.5f %8.4f  %4d %8.2f\n", how, inverted, crushed, worst,
         sqrt(sum / volume) / diagonal, sqrt(most) / diagonal, sqrt(sum / pose), steps, seconds);
  fflush(stdout);
  free(weight);
}

static void repair_both(const sample *s, const test_shape *shape, const double *given) {
  const ep_mesh *mesh = &shape->mesh;
  const size_t n3 = 3 * (size_t)mesh->nv;
  double *u = numbers(n3);
  ep_error err = {0};
  memcpy(u, given, n3 * sizeof *u);
  ep_repair_options o = ep_default_repair_options();
  ep_repair_report report;
  o.m = s->m;
  double start = ep_seconds();
  need(ep_lb_repair(mesh, &shape->lb, &o, u, &report, &err), &err);
  print_row("pose_repair", mesh, given, u, report.iterations, ep_seconds() - start);
  static const struct {
    const char *name;
    double poisson;
    int steps;
  } tries[] = {{"neo-Hookean .3, 5 steps", 0.3, 5},
               {"neo-Hookean .45, 5 steps", 0.45, 5},
               {"neo-Hookean .45, 40 steps", 0.45, 40},
               {"neo-Hookean .49, 40 steps", 0.49, 40}};
  for (size_t i = 0; i < sizeof tries / sizeof *tries; i++) {
    hooke h;
    memcpy(u, given, n3 * sizeof *u);
    start = ep_seconds();
    make_hooke(&h, shape, s->m, tries[i].poisson);
    const int steps = newton(&h, tries[i].steps, u);
    print_row(tries[i].name, mesh, given, u, steps, ep_seconds() - start);
    free_hooke(&h);
  }
  free(u);
}

static void run(const sample *s) {
  test_shape shape[3];
  double *given;
  make_pose(s, shape, &given);
  const ep_mesh *mesh = &shape[0].mesh;
  printf("%s x %g, m = %d: %d vertices, %d tets\n", s->name, s->times, s->m, mesh->nv, mesh->nt);
  print_row("as transferred", mesh, given, given, 0, 0);
  int inverted, crushed;
  double worst;
  count_tets(mesh, given, &inverted, &crushed, &worst);
  if (crushed)
    repair_both(s, &shape[0], given);
  else
    printf("  nothing to repair\n");
  free(given);
  for (int i = 0; i < 3; i++) shape_free(&shape[i]);
}

int main(int argc, char **argv) {
  ep_error err = {0};
  const char *word = argc > 1 ? argv[1] : "";
  if (ep_petsc_start(&err) != EP_OK) {
    fprintf(stderr, "%s\n", err.text);
    return 1;
  }
  printf("%-28s %5s %5s %8s  %8s %8s %8s  %4s %8s\n", "of the diagonal: moved, most", "inv.",
         "crush", "worst J", "moved", "most", "of pose", "step", "seconds");
  for (size_t i = 0; i < sizeof SAMPLES / sizeof *SAMPLES; i++) {
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", SAMPLES[i].folder, SAMPLES[i].object);
    FILE *there = fopen(path, "r");
    if (!there) {
      printf("%s left out: no %s\n", SAMPLES[i].name, path);
      continue;
    }
    fclose(there);
    if (strstr(SAMPLES[i].name, word)) run(&SAMPLES[i]);
  }
  ep_petsc_stop();
  return 0;
}
