// Cuboid [m]: stockier than the bar whose example it is. `size` chooses the resolution.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.07, Name "size"}];
Box(1) = {-0.5, -0.165, -0.15, 1.0, 0.33, 0.30};
Physical Volume("cuboid") = {1};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
