// Column [m]: an upright square bar, hung by its top.
SetFactory("OpenCASCADE");
Box(1) = {-0.13, -0.5, -0.13, 0.26, 1.0, 0.26};
Physical Volume("column") = {1};
Mesh.MeshSizeMin = 0.066;
Mesh.MeshSizeMax = 0.066;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
