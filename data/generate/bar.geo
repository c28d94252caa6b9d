// Bar: the animated object of the bar scenes [m]. Lengths give separated eigenvalues: 3 modes along
// the axis, then those across it.
SetFactory("OpenCASCADE");
Box(1) = {-0.5, -0.155, -0.14, 1.0, 0.31, 0.28};
Physical Volume("bar") = {1};
Mesh.MeshSizeMin = 0.062;
Mesh.MeshSizeMax = 0.062;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
