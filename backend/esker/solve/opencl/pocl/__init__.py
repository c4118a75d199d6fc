"""PoCL from its wheel, made to work on every x86-64 processor and without a toolchain (decisions 10 and 27)."""
