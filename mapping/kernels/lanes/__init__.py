"""Operations on vectors of points, beams or pixels, in the code that LLVM compiles."""
