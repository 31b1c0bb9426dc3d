// The solver's constraint rows of the step being computed: finding them, and setting their laws.
#ifndef JODA_ROWS_H_
#define JODA_ROWS_H_

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstddef>

#include "end_stop.h"
#include "engine.h"

namespace joda {

// Row among [first, last) of this step's constraints that belongs to the object, -1: none. Rows
// come in the order of their objects. `expected` is tried first, then bisection.
inline int FindRow(const mjData* d, int first, int last, int expected, int type, int id) {
  int row = first + expected;
  if (row < last && d->efc_type[row] == type && d->efc_id[row] == id) return row;
  int lo = first, hi = last;
  while (lo < hi) {
    row = (lo + hi) / 2;
    if (d->efc_type[row] == type && d->efc_id[row] == id) return row;
    const bool before =
        d->efc_type[row] < type || (d->efc_type[row] == type && d->efc_id[row] < id);
    (before ? lo : hi) = before ? row + 1 : row;
  }
  return -1;
}

// Calls visit(row, side) for the rows of the joint's limit; side is 1 at the low end, -1 at the
// high one. A margin may bring both ends near.
template <typename Visit>
void ForEachLimit(const mjModel* m, const mjData* d, int joint, int dof, const Visit& visit) {
  const int first = d->ne + d->nf, last = first + d->nl;
  const auto is_own = [&](int row) {
    return row >= first && row < last && d->efc_type[row] == mjCNSTR_LIMIT_JOINT &&
           d->efc_id[row] == joint;
  };
  int row = FindRow(d, first, last, 0, mjCNSTR_LIMIT_JOINT, joint);
  if (is_own(row - 1)) --row;
  for (; is_own(row); ++row) {
    const std::ptrdiff_t dense = static_cast<std::ptrdiff_t>(row) * m->nv + dof;
    visit(row, d->efc_J[mj_isSparse(m) ? d->efc_J_rowadr[row] : dense]);
  }
}

// What of the step is the same for all joints.
struct Step {
  const mjModel* m;
  double h, per_h;
  bool spring, damper, friction;  // not disabled
  bool keeps_rows;                // the solver will use the rows as they are set here

  explicit Step(const mjModel* m)
      : m(m),
        h(m->opt.timestep),
        per_h(1 / h),
        spring(!(m->opt.disableflags & kNoSpring)),
        damper(!(m->opt.disableflags & kNoDamper)),
        friction(!(m->opt.disableflags & mjDSBL_FRICTIONLOSS)),
        // the discrete integrator makes the rows anew behind the plugin, and noslip drops the
        // compliance of friction rows
        keeps_rows(!IsDiscrete(m) && m->opt.noslip_iterations == 0) {}

  // Whether the solver takes the rows in their dual form.
  bool IsDual() const { return m->opt.solver == mjSOL_PGS || m->opt.noslip_iterations > 0; }
};

// Gives the row another D, wherever the solvers read it.
inline void SetD(const Step& step, mjData* d, int row, double D) {
  const double R = 1 / D;
  // the dual solvers see R on the diagonal of A + R, which mj_inverse does not make
  if (step.IsDual() && d->efc_AR) {
    mjtNum* diagonal = d->efc_AR + static_cast<std::ptrdiff_t>(row) * (d->nefc + 1);
    if (mj_isSparse(step.m)) {
      const int* colind = d->efc_AR_colind + d->efc_AR_rowadr[row];
      const int* found = std::find(colind, colind + d->efc_AR_rownnz[row], row);
      diagonal = d->efc_AR + (found - d->efc_AR_colind);
    }
    *diagonal += R - d->efc_R[row];
  }
  d->efc_D[row] = D;
  d->efc_R[row] = R;
  CopyToIsland(d, row);
}

// Sets the reference a = -damping v - stiffness (pos - margin), which the engine computes right
// after the passive forces.
inline void SetReference(mjData* d, int row, double stiffness, double damping) {
  mjtNum* KBIP = d->efc_KBIP + 4 * row;
  KBIP[0] = stiffness;
  KBIP[1] = damping;
  KBIP[2] = 1;
}

// Makes the row resist the velocity at the end of the step: force = offset - D (a + v / h), within
// +-bound.
inline void SetRow(const Step& step, mjData* d, int row, double D, double bound, double offset) {
  d->efc_frictionloss[row] = bound;
  SetD(step, d, row, D);
  d->efc_pos[row] = -offset * d->efc_R[row];
  SetReference(d, row, 1, step.per_h);
}

// Makes the limit's row that of an end stop.
inline void SetStop(const Step& step, mjData* d, int row, const StopRow& stop) {
  SetD(step, d, row, stop.D);
  SetReference(d, row, stop.stiffness, stop.damping);
}

}  // namespace joda

#endif  // JODA_ROWS_H_
