#include "reduced/integrator.h"

const char *ep_integrator_name(ep_integrator kind) {
  static const char name[EP_INTEGRATORS][16] = {"implicit-euler", "newmark", "bdf2"};
  return (int)kind >= 0 && (int)kind < EP_INTEGRATORS ? name[kind] : NULL;
}

// v = (x - q)/h, a = (v(x) - v)/h
static void predict_euler(size_t n, double h, const ep_motion *m, double *base, double *ahead) {
  for (size_t i = 0; i < n; i++) {
    base[i] = m->q[i];
    ahead[i] = m->q[i] + h * m->v[i];
  }
}

// x = q + h v + h^2/4 (a + a(x)), v(x) = v + h/2 (a + a(x)) = 2/h (x - q) - v
static void predict_newmark(size_t n, double h, const ep_motion *m, double *base, double *ahead) {
  for (size_t i = 0; i < n; i++) {
    base[i] = m->q[i] + 0.5 * h * m->v[i];
    ahead[i] = m->q[i] + h * (m->v[i] + 0.25 * h * m->a[i]);
  }
}

// y' = ((1 + 2w) y - (1 + w)^2 y_0 + w^2 y_-1) / ((1 + w) h), w = h / h_before, for q and for v
// (Hairer, Norsett, Wanner, Solving ODEs I, III.5).
static void predict_bdf2(size_t n, double h, const ep_motion *m, double *base, double *ahead) {
  const double w = h / m->dt_before, now = (1 + w) * (1 + w) / (1 + 2 * w);
  const double before = w * w / (1 + 2 * w), step = (1 + w) * h / (1 + 2 * w);
  for (size_t i = 0; i < n; i++) {
    base[i] = now * m->q[i] - before * m->q_before[i];
    ahead[i] = base[i] + step * (now * m->v[i] - before * m->v_before[i]);
  }
}

double ep_integrator_before(ep_integrator kind, double dt, double dt_before) {
  static const double most = 2.414;
  return kind == EP_BDF2 && dt > most * dt_before ? 0 : dt_before;
}

void ep_integrator_predict(ep_integrator kind, size_t n, double dt, const ep_motion *motion,
                           double *base, double *ahead, double *rate, double *inertia) {
  *rate = 1 / dt;
  if (kind == EP_NEWMARK) {
    predict_newmark(n, dt, motion, base, ahead);
    *rate = 2 / dt;
  } else if (kind == EP_BDF2 && motion->dt_before > 0) {
    const double w = dt / motion->dt_before;
    predict_bdf2(n, dt, motion, base, ahead);
    *rate = (1 + 2 * w) / ((1 + w) * dt);
  } else {
    predict_euler(n, dt, motion, base, ahead);
  }
  *inertia = *rate * *rate;
}
