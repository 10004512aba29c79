"""How formulas become machine code: tracing, elementary functions, intrinsics, memory, the compiler, its cache."""
