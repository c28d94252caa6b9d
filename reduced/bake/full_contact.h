// Contact of the full-space reference: the law of reduced/contact_point.h on every surface vertex
// that is not held, by a plain loop. Private to the full-space step.
#ifndef EP_BAKE_FULL_CONTACT_H
#define EP_BAKE_FULL_CONTACT_H

#include "reduced/bake/fem.h"
#include "reduced/contact_law.h"

typedef struct ep_full_contact {
  const ep_mesh *mesh;
  int count;
  int *vertex;                 // (count) on the surface, not held
  double *area;                // (count)
  double unit, extent;         // as ep_contact_choose
  double *start, *lag, *ahead; // (3n) displacements: step's start, normal forces, free flight
  ep_contact_memory memory;
} ep_full_contact;

// fem is borrowed. Errors: EP_ERR_MEMORY.
ep_status ep_full_contact_create(const ep_fem *fem, ep_full_contact **out, ep_error *err);
void ep_full_contact_free(ep_full_contact *contact);
// As the functions of reduced/contact.h, for displacements (3n).
void ep_full_contact_begin(ep_full_contact *contact, const ep_step_def *def, double dt_before,
                           const double *start, const double *ahead);
// Gradient added to g (3n), Hessian to k (3 x 3 blocks on the diagonal) unless NULL.
double ep_full_contact_energy(ep_full_contact *contact, const ep_step_def *def, const double *u,
                              double *g, ep_csr *k);
int ep_full_contact_again(ep_full_contact *contact, const ep_step_def *def, const double *u);
// Torque about the origin.
void ep_full_contact_measure(ep_full_contact *contact, const ep_step_def *def, const double *u,
                             ep_contact_report *report);

#endif
