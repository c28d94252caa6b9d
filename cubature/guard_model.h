// A reduced model whose guards grow while it is pushed about (cubature/guards.h). Private.
#ifndef EP_CUBATURE_GUARD_MODEL_H
#define EP_CUBATURE_GUARD_MODEL_H

#include "cubature/cubature.h"
#include "reduced/bake/model_build.h"

typedef struct ep_guard_model {
  const ep_fem *fem;      // borrowed
  const ep_basis *basis;  // borrowed
  int nt;                 // tets of the mesh
  ep_model_memory memory; // without guards, examples and rigid motion
  ep_model model;         // the same with the guards so far
  int most;
  int *tet; // (most) guards in the order they came; model.size.guards of them
  // arrays of the model (most)
  int32_t *number;
  double *w, *stiffness, *limit, *g, *growth;
  double *around;  // (nt) volume around each element: the weight it would have
  double *allowed; // (nt) the limit it would have; 0: no guard (an example turns it over)
  double *ratio;   // (nt) J of all elements when last looked at
  double *rest;    // (nt) 1 / determinant of the edges at rest
  double *x;       // (3 nv) scratch: positions or displacements
  double *before;  // (2 r) coordinates and velocities at the beginning of the last step
  double *rows;    // (9 x r) scratch
  void *block;     // of the state
  ep_state *state;
  double dt;        // [s] a part of the longest period
  long evaluations; // of the energy, in all steps so far
} ep_guard_model;

// Errors: EP_ERR_MEMORY, EP_ERR_NUMERIC (K0), those of ep_model_build.
ep_status ep_guard_model_create(const ep_fem *fem, const ep_basis *basis,
                                const ep_cubature *cubature, int most, ep_guard_model *out,
                                ep_error *err);
void ep_guard_model_free(ep_guard_model *m);

// false where there are `most` already, or the element is spared.
bool ep_guard_model_add(ep_guard_model *m, int tet);
// A state at rest that knows the guards so far. Errors: EP_ERR_NUMERIC.
ep_status ep_guard_model_begin(ep_guard_model *m, ep_error *err);
// One step under the generalised force (r); in halves where it fails. false: it fails all the same.
bool ep_guard_model_step(ep_guard_model *m, const double *force);
// To where the last step began, with the guards so far. Errors: EP_ERR_NUMERIC.
ep_status ep_guard_model_back(ep_guard_model *m, ep_error *err);
// Fills ratio; elements with J <= 0, those that are spared not counted. -1: not finite.
int ep_guard_model_inverted(ep_guard_model *m);
// Largest displacement of a vertex at q [length].
double ep_guard_model_reach(ep_guard_model *m, const double *q);

#endif
