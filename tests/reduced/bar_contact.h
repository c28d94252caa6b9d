// Contact vertices and their tree for the test bar, made by the bake's own code.
#ifndef EP_TESTS_REDUCED_BAR_CONTACT_H
#define EP_TESTS_REDUCED_BAR_CONTACT_H

#include "reduced/bake/contact_tree.h"
#include "tests/reduced/bar.h"

// Fills the model's contact arrays; `tree` owns them (ep_contact_tree_free). young: Young's modulus
// the automatic stiffness goes by [Pa]. Aborts without memory. Before states are made.
void bar_add_contact(bar *b, double young, ep_contact_tree *tree);

#endif
