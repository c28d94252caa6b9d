// The arrays of a model, one list: it drives what is in the struct, saved, loaded and checked.
//   X(type, name, dimension 1, dimension 2, dimension 3)      type: double, float or int32 (int)
// Dimensions are members of ep_model_sizes (or literals). Arrays whose product is 0 are absent.
//
//   sizes: n vertices, nt tets, r modes, m LB functions of the descriptor (the constant one
//   included for constrained objects; 0 where no descriptors are used; with regions the sum of
//   theirs), k examples, regions sets of examples (0: one set, acting everywhere), s cubature
//   elements, blocks = ceil(r / 8): groups of 8 modes, greens independent strains of the examples
//   (Green-strain path; 0: not used), guards elements that only keep themselves from turning over
//   (reduced/guard.h; 0: none), cubic and cubic_float reals of the cubic path's streams (0:
//   not used; then without interpolation s may be 0), rigid 1 where nothing is held (free motion),
//   contacts surface vertices that can move and nodes of the tree over them (0: no obstacles).
#ifndef EP_REDUCED_MODEL_ARRAYS_H
#define EP_REDUCED_MODEL_ARRAYS_H

#define EP_MODEL_SIZES(X)                                                                          \
  X(n)                                                                                             \
  X(nt)                                                                                            \
  X(r) X(m) X(k) X(regions) X(s) X(blocks) X(greens) X(cubic) X(cubic_float) X(cubature_float)     \
      X(guards) X(rigid) X(contacts) X(nodes)

// clang-format off
#define EP_MODEL_ARRAYS(X)                                                                        \
  /* display: positions at rest, tets, modes (r x 3n, mass-orthonormal rows) */                   \
  X(double, rest_x,        n, 3, 1)                                                               \
  X(int32,  tets,          nt, 4, 1)                                                              \
  X(double, u,             r, n, 3)                                                               \
  /* dynamics: K0 = U^T K(0) U [1/s^2 in mass-orthonormal coordinates] */                          \
  X(double, k0,            r, r, 1)                                                               \
  /* descriptors: c(q) = c0 + T q, T (3m x r) row-major, row = 3 * function + axis */              \
  X(double, c0,            m, 3, 1)                                                               \
  X(double, t,             m, 3, r)                                                               \
  /* examples: reduced coordinates and descriptors of each pose */                                \
  X(double, example_q,     k, r, 1)                                                               \
  X(double, example_c,     k, m, 3)                                                               \
  /* cubature: element number, weight (absolute volume), Lame constants */                        \
  X(int32,  cubature_tet,  s, 1, 1)                                                               \
  X(double, cubature_w,    s, 1, 1)                                                               \
  X(double, cubature_lambda, s, 1, 1)                                                             \
  X(double, cubature_mu,   s, 1, 1)                                                               \
  /* F_j = I + sum_a q_a G_j,a: lanes of 8 modes, [element][block][9 entries of F][8 modes], */    \
  /* modes beyond r zero. Filled by ep_pack_cubature alone: no one else knows this layout */       \
  X(double, cubature_g,    s, blocks, 72)                                                         \
  /* the same in floats: [element][9 entries of F][modes, in sixteens]; what else is evaluated at */ \
  /* these elements (penalty, scales, targets at rest) reads the doubles */                         \
  X(float,  cubature_g_float, cubature_float, 9, 16 * ((r + 15) / 16))                            \
  /* per example, per cubature element: inverse of F_i (row-major 9) and w |det F_i| */           \
  X(double, example_finv,  m ? k : 0, s, 9)                                                       \
  X(double, example_w,     m ? k : 0, s, 1)                                                       \
  /* regions (reduced/region.h): set of each example; first function of each region's descriptor; */\
  /* weights of the elements inside and outside (their sum is cubature_w; of examples, example_w */\
  /* is theirs inside); whether the region is carried along, not held: then its motion is taken  */\
  /* out of the descriptor, by rows A (9) and centre (3) of q and at rest, and sums of functions */\
  X(int32,  example_region, regions ? k : 0, 1, 1)                                                \
  X(int32,  region_first,  regions ? regions + 1 : 0, 1, 1)                                       \
  X(double, region_inside, regions, s, 1)                                                         \
  X(double, region_outside, regions, s, 1)                                                        \
  X(int32,  region_carried, regions, 1, 1)                                                        \
  X(double, region_motion, regions, 12, r)                                                        \
  X(double, region_motion_rest, regions, 12, 1)                                                   \
  X(double, region_mean,   regions ? m : 0, 1, 1)                                                 \
  /* Green-strain path: y_i = linear_i . q + 1/2 q^T B_i q of orthonormal combinations of the */  \
  /* examples' strains, B_i in 8 x 8 tiles (reduced/green.h); weights w = V y, V (k x greens); */ \
  /* strain energy of each example; their mean, the unit of the weights' penalties */             \
  X(double, green_b,       greens, blocks * (blocks + 1) / 2, 64)                                 \
  X(double, green_linear,  greens, blocks, 8)                                                     \
  X(double, green_weights, k, greens, 1)                                                          \
  X(double, green_energy,  greens ? k : 0, 1, 1)                                                  \
  X(double, green_scale,   greens ? 1 : 0, 1, 1)                                                  \
  /* guards (reduced/guard.h): element number, weight [volume], stiffness [Pa], share of its    */ \
  /* volume below which it resists; G packed as of cubature; per group of 8 guards the largest   */ \
  /* |G_a|_F of each mode, modes beyond r zero */                                                 \
  X(int32,  guard_tet,     guards, 1, 1)                                                          \
  X(double, guard_w,       guards, 1, 1)                                                          \
  X(double, guard_stiffness, guards, 1, 1)                                                        \
  X(double, guard_limit,   guards, 1, 1)                                                          \
  X(double, guard_g,       guards, blocks, 72)                                                    \
  X(double, guard_growth,  (guards + 7) / 8, blocks, 8)                                           \
  /* exact StVK energy over all elements as one quartic form (reduced/cubic.h), in doubles, in */ \
  /* floats; sums over all elements: largest |G_e|_F, energy and force at unit strain */          \
  X(double, cubic_stream,  cubic, 1, 1)                                                           \
  X(float,  cubic_stream_float, cubic_float, 1, 1)                                                \
  X(double, cubic_scales,  cubic > 0 || cubic_float > 0 ? 3 : 0, 1, 1)                            \
  /* free motion (reduced/frame.h), with y = X - X_0 + U q: mass, X_0, and the sums that give */   \
  /* sum m y y^T = S0 + sum_a q_a S1_a + sum_ab q_a q_b S2_ab and sum m U q x U q'. Symmetric */    \
  /* 3 x 3 as xx yy zz yz zx xy; S1_a = sum m (X U_a^T + U_a X^T); pairs a >= b in lower */         \
  /* triangles, row by row: S2_ab = sum m (U_a U_b^T + U_b U_a^T) / 2, h_ab = sum m U_a x U_b */    \
  X(double, rigid_mass,    rigid, 1, 1)                                                           \
  X(double, rigid_origin,  rigid, 3, 1)                                                           \
  X(double, rigid_s0,      rigid, 6, 1)                                                           \
  X(double, rigid_s1,      rigid, 6, r)                                                           \
  X(double, rigid_s2,      rigid, 6, r * (r + 1) / 2)                                             \
  X(double, rigid_h,       rigid, 3, r * (r + 1) / 2)                  \
  /* a held object under gravity: sum m U_a, so that the force is its product with gravity [mass] */ \
  X(double, gravity_modes, rigid ? 0 : 3, r, 1)                                                   \
  /* contact (reduced/contact.h), vertices in the tree's order: number in the mesh, position at */ \
  /* rest, area, rows of U; per node: first vertex, end, next node when passed over; ball at */   \
  /* rest, its centre's rows of U, growth of its radius by each |q_k|; Young's modulus over the */ \
  /* extent [Pa/m] */                                                                             \
  X(int32,  contact_vertex, contacts, 1, 1)                                                       \
  X(double, contact_x,     contacts, 3, 1)                                                        \
  X(double, contact_area,  contacts, 1, 1)                                                        \
  X(double, contact_u,     contacts, 3, r)                                                        \
  X(int32,  tree_range,    nodes, 3, 1)                                                           \
  X(double, tree_center,   nodes, 3, 1)                                                           \
  X(double, tree_u,        nodes, 3, r)                                                           \
  X(double, tree_radius,   nodes, 1, 1)                                                           \
  X(double, tree_growth,   nodes, r, 1)                                                           \
  X(double, contact_scale, contacts ? 1 : 0, 1, 1)
// clang-format on

// Their number: arrays[EP_MODEL_ARRAY_COUNT] holds something of each.
enum {
#define X(type, name, d1, d2, d3) EP_MODEL_ARRAY_##name,
  EP_MODEL_ARRAYS(X)
#undef X
      EP_MODEL_ARRAY_COUNT
};

#endif
