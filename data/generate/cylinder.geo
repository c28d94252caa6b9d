// Cylinder of slightly elliptical section, about the bar's size [m]. `size` chooses the resolution:
// rest and twisted pose share one mesh, the S-bent pose has a coarser one of its own.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.058, Name "size"}];
Cylinder(1) = {-0.5, 0, 0, 1.0, 0, 0, 1.0};
Dilate {{0, 0, 0}, {1, 0.182, 0.164}} { Volume{1}; }
Physical Volume("cylinder") = {1};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
