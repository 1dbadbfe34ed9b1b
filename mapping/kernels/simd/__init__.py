"""Vector operations of kernels: each is defined in numpy, above the LLVM text that it is compiled from."""
