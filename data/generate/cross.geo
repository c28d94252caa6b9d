// Cross [m] in the xy-plane. `round` makes the one of the examples: arms of round section.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.062, Name "size"}, round = {0, Name "round"}];
If (round)
  Cylinder(1) = {-0.62, 0.02, 0, 1.24, 0, 0, 0.125};
  Cylinder(2) = {0, -0.62, 0, 0, 1.24, 0, 0.13};
Else
  Box(1) = {-0.6, -0.11, -0.10, 1.2, 0.22, 0.20};
  Box(2) = {-0.12, -0.6, -0.10, 0.24, 1.2, 0.20};
EndIf
whole() = BooleanUnion { Volume{1}; Delete; } { Volume{2}; Delete; };
Physical Volume("cross") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
