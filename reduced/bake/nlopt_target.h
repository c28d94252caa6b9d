// Shape interpolation by NLopt: an ep_target_solver for ep_step_def.target_solver, with variables
// scaled so that the Hessian at rest is the identity. The only user of NLopt at run time.
#ifndef EP_BAKE_NLOPT_TARGET_H
#define EP_BAKE_NLOPT_TARGET_H

#include "base/error.h"
#include "reduced/eigenpose.h"

// One per state (it keeps NLopt's object and work arrays between steps).
typedef struct ep_nlopt_target ep_nlopt_target;

// algorithm: NLopt's name of a local gradient-based one ("LD_LBFGS" (NULL: this), "LD_SLSQP",
// "LD_TNEWTON_PRECOND_RESTART", "LD_VAR2", "LD_MMA", ...). max_evaluations: per interpolation
// (0: 1000). Free with ep_nlopt_target_free (NULL allowed).
// Errors: EP_ERR_ARGUMENT (unknown, global or derivative-free algorithm), EP_ERR_MEMORY.
ep_status ep_nlopt_target_create(const ep_state *state, const char *algorithm, int max_evaluations,
                                 ep_nlopt_target **out, ep_error *err);
void ep_nlopt_target_free(ep_nlopt_target *target);

// The solver; user is an ep_nlopt_target. Stops at ep_target_residual <= tolerance, checked here on
// every evaluation: NLopt's own return codes do not tell (MAXEVAL is positive, ROUNDOFF_LIMITED
// negative and often usable), and its stopping rules know no gradient. An early stop of the
// algorithm is answered with a restart from the best point.
// Errors: EP_ERR_NUMERIC where the tolerance was not reached; q is unchanged then.
ep_status ep_nlopt_target_solve(void *user, ep_state *state, const double *w, double *q,
                                double tolerance, ep_target_report *report);

// What NLopt last said ("NLOPT_FORCED_STOP" is the normal end), for reports.
const char *ep_nlopt_target_result(const ep_nlopt_target *target);

#endif
