"""How formulas become machine code: the recorder, elementary functions, intrinsics, memory, assembly."""
