// A free box as a model, through the bake: modes, basis, inertia sums, all elements. Its motion in
// sums over vertices, independent of the sums in the model.
#ifndef EP_TESTS_BAKE_FREE_BODY_H
#define EP_TESTS_BAKE_FREE_BODY_H

#include "linalg/petsc.h"
#include "reduced/bake/inertia.h"
#include "whole_model.h"

enum { FREE_FUNCTIONS = 4 };

typedef struct free_body {
  bar b;
  ep_csr mass; // scalar
  ep_modes modes;
  ep_basis basis;
  double *pose, *phi;             // (examples x 3n), (FREE_FUNCTIONS x n)
  const ep_contact_tree *contact; // borrowed, or NULL
  whole_model whole;
  const ep_model *model; // of it
  ep_state *state;
} free_body;

// The model and a state from f->basis.
static inline void finish_free_body(free_body *f) {
  const ep_lb lb = {.n = f->b.mesh.nv, .m = FREE_FUNCTIONS, .volume = 1, .phi = f->phi};
  make_whole_model((ep_model_parts){.fem = &f->b.fem,
                                    .basis = &f->basis,
                                    .m = f->basis.examples ? FREE_FUNCTIONS : 0,
                                    .lb = &lb,
                                    .lb_mass = &f->mass,
                                    .contact = f->contact},
                   &f->whole);
  f->model = &f->whole.memory.model;
  f->state = f->whole.state;
}

// Mesh, masses and `linear` modes only.
static inline void begin_free_body(free_body *f, const int cells[3], const double size[3],
                                   ep_material law, ep_elastic elastic, int linear) {
  *f = (free_body){0};
  make_bar(&f->b, cells, size, law, elastic, 0);
  ASSERT_OK(ep_fem_scalar_mass(&f->b.fem, &f->mass, err));
  ASSERT_OK(ep_modes_compute(&f->b.fem, linear, NULL, &f->modes, err));
}

// r modes from `linear` linear ones, `examples` smooth random poses in the basis (with descriptors
// of cosines, which serve as well as eigenfunctions here).
static inline void make_free_body(free_body *f, const int cells[3], const double size[3],
                                  ep_material law, ep_elastic elastic, int linear, int r,
                                  int examples) {
  begin_free_body(f, cells, size, law, elastic, linear);
  const int nv = f->b.mesh.nv;
  f->pose = vector_of((size_t)examples * f->b.n3 + 1);
  for (int i = 0; i < examples; i++) {
    double *pose = f->pose + (size_t)i * f->b.n3;
    smooth_random(&f->b, 40 + (uint64_t)i, 0.15 * size[0], pose);
    ASSERT_OK(ep_rigid_fit(&f->b.mesh, &f->mass, pose, err));
  }
  ASSERT_OK(
      ep_basis_build(&f->b.fem, &f->modes, examples, f->pose, 0, NULL, r, NULL, &f->basis, err));
  f->phi = vector_of(FREE_FUNCTIONS * (size_t)nv);
  for (int k = 0; k < FREE_FUNCTIONS; k++)
    for (int v = 0; v < nv; v++)
      f->phi[k * nv + v] = cos((k + 1) * (f->b.mesh.x[3 * v] / size[0] + 0.3 * k));
  finish_free_body(f);
}

static inline void drop_free_body(free_body *f) {
  free_whole_model(&f->whole);
  ep_basis_free(&f->basis);
  ep_modes_free(&f->modes);
  ep_csr_free(&f->mass);
  free(f->pose);
  free(f->phi);
  free_bar(&f->b);
}

static inline double dot_rows(const double row[3], const double u[3]) {
  return row[0] * u[0] + row[1] * u[1] + row[2] * u[2];
}

// Positions and velocities of the vertices in the world (n x 3 each), from the state's own
// c' + omega x (x - c) + R U q'.
static inline void motion_of(const free_body *f, double *x, double *v) {
  const size_t n = (size_t)f->b.mesh.nv;
  const ep_frame *frame = ep_state_frame(f->state);
  double velocity[3], spin[3];
  const double *rate = ep_state_velocity(f->state);
  ep_state_positions(f->state, x);
  ep_state_motion(f->state, velocity, spin);
  for (size_t i = 0; i < n; i++) {
    double d[3], u[3] = {0};
    for (size_t k = 0; k < 3; k++) d[k] = x[3 * i + k] - frame->c[k];
    for (int a = 0; a < f->model->size.r; a++)
      for (size_t k = 0; k < 3; k++) u[k] += rate[a] * f->model->u[(size_t)a * 3 * n + 3 * i + k];
    for (size_t k = 0; k < 3; k++)
      v[3 * i + k] = velocity[k] + spin[(k + 1) % 3] * d[(k + 2) % 3] -
                     spin[(k + 2) % 3] * d[(k + 1) % 3] + dot_rows(frame->R + 3 * k, u);
  }
}

// sum m x, sum m v and sum m x cross v about the origin, with the consistent mass; kinetic energy.
static inline double sums_of(const free_body *f, const double *x, const double *v, double center[3],
                             double linear[3], double angular[3]) {
  const size_t n = (size_t)f->b.mesh.nv;
  double *mv = vector_of(3 * n), total = 0, energy = 0;
  ep_csr_multiply(&f->mass, 3, v, mv);
  for (int k = 0; k < 3; k++) center[k] = linear[k] = angular[k] = 0;
  for (size_t i = 0; i < n; i++)
    for (size_t k = 0; k < 3; k++) {
      linear[k] += mv[3 * i + k];
      angular[k] += x[3 * i + (k + 1) % 3] * mv[3 * i + (k + 2) % 3] -
                    x[3 * i + (k + 2) % 3] * mv[3 * i + (k + 1) % 3];
      energy += 0.5 * v[3 * i + k] * mv[3 * i + k];
    }
  ep_csr_multiply(&f->mass, 3, x, mv);
  for (size_t i = 0; i < 3 * n; i++) center[i % 3] += mv[i];
  for (int at = 0; at < f->mass.start[n]; at++) total += f->mass.value[at];
  for (int k = 0; k < 3; k++) center[k] /= total;
  free(mv);
  return energy;
}

#endif
