// A deformed shape taken as the undeformed one: what an element of it is worth.
#ifndef EP_REDUCED_REFERENCE_H
#define EP_REDUCED_REFERENCE_H

// f (9, row-major): deformation gradient of the reference shape at an element.
// inverse (9): F^-1; the identity where the element is not usable.
// Returns the weight of the element per unit of rest volume,
//     |det F| min(1, sigma_min / 0.7)^4,
// and 0 where the element is turned over or its smallest stretch sigma_min is below 0.05.
//
// |det F| is Zhao et al. 2018 eq. 6 with the example as undeformed material. The second factor is
// ours: the energy of F_t F^-1 grows with sigma_min^-4 (St. Venant-Kirchhoff), so that a few elements
// an example squeezes would outvote all others in the interpolation. Measured on the car of
// Zhao et al. (11 of 60 elements below 0.5): with weights .9 / .1 for rest and pose the target stood
// at .62 of the way to the pose without the factor, at .19 with it; at .5 / .5 at .81 and .58.
// The zero of the energy, the pose itself, stays where it is.
double ep_reference_element(const double f[9], double inverse[9]);

#endif
