"""The cloth simulation: model, state, step, solvers and kernels."""
